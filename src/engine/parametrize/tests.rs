//! Charts of surfaces whose maps are known, and of surfaces made to defeat them.

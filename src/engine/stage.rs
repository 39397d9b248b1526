//! The stage cache: content keys, a budget in bytes, one computation per key.

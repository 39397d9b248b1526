//! Sparse direct solvers for the engine. The only crate that names faer, so that its templates compile once.

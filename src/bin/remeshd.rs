//! `remeshd`: the remeshing daemon. Settings, bind, serve, drain.
fn main() {}

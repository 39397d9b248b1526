//! Sessions: the inputs of a remeshing job, their revisions and immutable snapshots.

//! The one file that ties stage functions to stage keys, in the order of the pipeline.

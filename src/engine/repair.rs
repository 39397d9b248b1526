//! Repairs that change no geometry: welding, dropping duplicate and zero-area faces, orienting, splitting bow-tie vertices.

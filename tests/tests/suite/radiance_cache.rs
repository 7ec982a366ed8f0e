//! Which clusters of pixels have a radiance cache, and where it is.

mod clusters;

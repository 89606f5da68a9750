//! What must be known about one device and site (PIXIT): `device.toml`, its defaults, and where each
//! effective value came from.

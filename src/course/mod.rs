//! Layouts (LIF) and courses: drivable nodes and edges a test may use, mapped onto the real floor.

//! How many files and connections this process may have open: often a thousand, and a fleet needs more.

/// What is open besides the connections of a fleet.
const BESIDES: u64 = 256;
/// What a vehicle may need: its connection, the embedded broker's end of it, and one that watches for its last will.
const EACH: u64 = 3;

/// Asks the system for as many as so many vehicles need, where it allows fewer.
pub fn allow(vehicles: u32) {
    raise(u64::from(vehicles) * EACH + BESIDES);
}

#[cfg(unix)]
fn raise(needed: u64) {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let limit = getrlimit(Resource::Nofile);
    if limit.current.is_none_or(|current| current >= needed) {
        return;
    }
    let allowed = limit.maximum.map_or(needed, |maximum| maximum.min(needed));
    let raised = Rlimit {
        current: Some(allowed),
        ..limit
    };
    let is_raised = setrlimit(Resource::Nofile, raised).is_ok();
    if allowed < needed || !is_raised {
        eprintln!(
            "the system allows {allowed} open files, and a fleet of this size may need {needed}; see `ulimit -n`"
        );
    }
}

#[cfg(not(unix))]
fn raise(_needed: u64) {}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use rustix::process::{Resource, getrlimit};

    use super::*;

    #[test]
    fn a_fleet_gets_what_the_system_allows_and_nothing_is_taken_away() {
        let before = getrlimit(Resource::Nofile);
        allow(1);
        let first = getrlimit(Resource::Nofile);
        assert!(first.current.unwrap_or(u64::MAX) >= before.current.unwrap_or(u64::MAX));
        let needed = 3_256_u64.min(before.maximum.unwrap_or(u64::MAX));
        allow(1_000);
        assert!(getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX) >= needed);
    }
}

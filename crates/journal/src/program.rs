//! What becomes of the program that a run has started, and whose a connection is.

use serde::{Deserialize, Serialize};

/// What has become of the program of `device.command`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "what", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Program {
    /// It was started.
    Started {
        /// The number of the process from which all of it descends.
        process: u32,
        /// Whether the system tells which connections it has.
        traces: bool,
    },
    /// It is about to be ended, or asked to end: what ends from now on does not end by itself.
    Asked {
        /// By what: a hook, or the harness.
        by: String,
    },
    /// It has ended.
    Ended {
        /// How.
        how: Ending,
        /// What it printed last.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        words: String,
    },
}

/// How a program has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// With this exit status.
    Status(i32),
    /// By this signal.
    Signal(i32),
    /// Nobody was told.
    Unknown,
}

impl Ending {
    /// The ending that the system tells of a process.
    #[must_use]
    pub fn of(status: std::process::ExitStatus) -> Self {
        #[cfg(unix)]
        if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
            return Self::Signal(signal);
        }
        status.code().map_or(Self::Unknown, Self::Status)
    }
}

impl std::fmt::Display for Ending {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Status(status) => write!(f, "exit status {status}"),
            Self::Signal(signal) => match name(*signal) {
                Some(name) => write!(f, "signal {signal} ({name})"),
                None => write!(f, "signal {signal}"),
            },
            Self::Unknown => f.write_str("an exit that nobody was told"),
        }
    }
}

/// The name of a signal whose number is everywhere the same.
fn name(signal: i32) -> Option<&'static str> {
    Some(match signal {
        1 => "SIGHUP",
        2 => "SIGINT",
        3 => "SIGQUIT",
        4 => "SIGILL",
        5 => "SIGTRAP",
        6 => "SIGABRT",
        8 => "SIGFPE",
        9 => "SIGKILL",
        11 => "SIGSEGV",
        13 => "SIGPIPE",
        15 => "SIGTERM",
        _ => return None,
    })
}

/// Whose the other end of a connection is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "of", rename_all = "kebab-case", rename_all_fields = "camelCase")]
pub enum Origin {
    /// The program that the run has started has it, or what that has started.
    Started {
        /// The number of the process.
        process: u32,
    },
    /// Another program of this machine has it.
    Other {
        /// The number of its process, where it may be seen.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        process: Option<u32>,
        /// What it is called, where that may be seen.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        name: Option<String>,
    },
    /// A program of this machine had it, which was gone before it could be looked for, or may not be seen.
    Unseen,
    /// Another machine has it, or what looks like one, such as a container.
    Elsewhere,
}

impl Origin {
    /// Whether it is known not to be what was started.
    #[must_use]
    pub const fn is_foreign(&self) -> bool {
        matches!(self, Self::Other { .. })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endings_are_said_as_an_engineer_says_them() {
        assert_eq!(Ending::Status(7).to_string(), "exit status 7");
        assert_eq!(Ending::Signal(9).to_string(), "signal 9 (SIGKILL)");
        assert_eq!(Ending::Signal(63).to_string(), "signal 63");
    }

    #[test]
    fn what_is_recorded_reads_back_as_it_was() {
        let all = [
            Program::Started {
                process: 7,
                traces: true,
            },
            Program::Asked {
                by: "hook `shutdown`".to_owned(),
            },
            Program::Ended {
                how: Ending::Signal(9),
                words: "panic".to_owned(),
            },
        ];
        for program in all {
            let text = serde_json::to_string(&program).unwrap();
            assert_eq!(serde_json::from_str::<Program>(&text).unwrap(), program, "{text}");
        }
    }
}

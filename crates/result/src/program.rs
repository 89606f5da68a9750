//! What has become of the program that the run has started, and whether it is known who was judged.

use serde::{Deserialize, Serialize};

use tck_base::verdict::Verdict;

/// The program of `device.command`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramResult {
    /// How often it was started.
    pub starts: u64,
    /// How often it ended by itself: not asked to by a hook, a person, or the end of the run.
    pub ends: u64,
    /// How many of these ends somebody else may have brought about.
    pub excused: u64,
    /// The first of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shown: Vec<ProgramEnd>,
}

/// A program that ended by itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProgramEnd {
    /// Exit status or signal.
    pub how: String,
    /// The journal number of its end.
    pub seq: u64,
    /// How long after its start, in seconds.
    pub seconds: f64,
    /// The message that was sent last before it, by journal number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sent: Option<u64>,
    /// What it printed last.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub words: String,
    /// Why somebody else may have brought it about.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excuse: Option<String>,
}

impl ProgramEnd {
    /// What happened, in one sentence without its end.
    #[must_use]
    pub fn story(&self) -> String {
        let mut text = format!(
            "the program of `device.command` ended by itself with {}, {:.1} s after its start",
            self.how, self.seconds
        );
        if let Some(sent) = self.sent {
            text.push_str(&format!("; the last message it was sent is #{sent}"));
        }
        if !self.words.is_empty() {
            text.push_str(&format!("; it printed last: {}", self.words.replace('\n', " | ")));
        }
        text
    }
}

impl ProgramResult {
    /// What its ends mean; nothing when it never ended by itself.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        match (self.ends, self.excused) {
            (0, _) => None,
            (ends, excused) if ends > excused => Some(Verdict::Fail),
            _ => Some(Verdict::Inconclusive),
        }
    }

    /// The end that counts: the first that nobody else may have brought about.
    #[must_use]
    pub fn first(&self) -> Option<&ProgramEnd> {
        let own = self.shown.iter().find(|end| end.excuse.is_none());
        own.or_else(|| self.shown.first())
    }

    /// What happened, in one sentence without its end; nothing when it never ended by itself.
    #[must_use]
    pub fn story(&self) -> Option<String> {
        let first = self.first()?;
        let more = match self.ends {
            1 => String::new(),
            2 => "; it ended so once more".to_owned(),
            ends => format!("; it ended so {ends} times in all"),
        };
        let excuse = first.excuse.as_ref();
        let excuse = excuse.map_or_else(String::new, |why| {
            format!("; whether by itself cannot be told, since {why}")
        });
        Some(format!("{}{more}{excuse}", first.story()))
    }

    /// Puts together what became of it in a run and in the one after it.
    #[must_use]
    pub fn and(mut self, later: Option<Self>) -> Self {
        if let Some(later) = later {
            self.starts += later.starts;
            self.ends += later.ends;
            self.excused += later.excused;
            self.shown.extend(later.shown);
        }
        self
    }
}

//! Protocol versions and ranges of them.

use std::fmt;
use std::str::FromStr;

/// A protocol version: `2.1` or `2.1.0`. Ordered by major and minor; the patch level never matters to a rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Version {
    /// Major.
    pub major: u64,
    /// Minor.
    pub minor: u64,
    /// Patch, if it was given.
    pub patch: Option<u64>,
}

impl FromStr for Version {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Vec<&str> = text.trim().split('.').collect();
        let number = |part: &str| {
            part.parse::<u64>()
                .map_err(|_| format!("`{text}` is not a version such as 1.2 or 1.2.3"))
        };
        match parts.as_slice() {
            [major] => Ok(Self {
                major: number(major)?,
                minor: 0,
                patch: None,
            }),
            [major, minor] => Ok(Self {
                major: number(major)?,
                minor: number(minor)?,
                patch: None,
            }),
            [major, minor, patch] => Ok(Self {
                major: number(major)?,
                minor: number(minor)?,
                patch: Some(number(patch)?),
            }),
            _ => Err(format!("`{text}` is not a version such as 1.2 or 1.2.3")),
        }
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)?;
        self.patch.map_or(Ok(()), |patch| write!(f, ".{patch}"))
    }
}

impl Version {
    fn key(self) -> (u64, u64) {
        (self.major, self.minor)
    }
}

/// A range such as `>=1.0, <3`: every part must hold.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VersionRange(Vec<(Bound, Version)>);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bound {
    AtLeast,
    Above,
    AtMost,
    Below,
    Exactly,
}

impl Bound {
    const ALL: [(&'static str, Self); 5] = [
        (">=", Self::AtLeast),
        ("<=", Self::AtMost),
        (">", Self::Above),
        ("<", Self::Below),
        ("=", Self::Exactly),
    ];
}

impl VersionRange {
    /// Whether `version` lies in the range; the patch level is ignored.
    #[must_use]
    pub fn contains(&self, version: Version) -> bool {
        self.0.iter().all(|(bound, limit)| {
            let order = version.key().cmp(&limit.key());
            match bound {
                Bound::AtLeast => order.is_ge(),
                Bound::Above => order.is_gt(),
                Bound::AtMost => order.is_le(),
                Bound::Below => order.is_lt(),
                Bound::Exactly => order.is_eq(),
            }
        })
    }
}

impl FromStr for VersionRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split(',')
            .map(str::trim)
            .map(|part| {
                let (word, bound) = Bound::ALL
                    .into_iter()
                    .find(|(word, _)| part.starts_with(word))
                    .ok_or_else(|| format!("`{part}` does not begin with one of >=, <=, >, <, ="))?;
                Ok((bound, part[word.len()..].parse()?))
            })
            .collect::<Result<_, String>>()
            .map(Self)
    }
}

impl fmt::Display for VersionRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, (bound, version)) in self.0.iter().enumerate() {
            let word = Bound::ALL
                .iter()
                .find(|(_, other)| other == bound)
                .map_or("", |(word, _)| word);
            write!(f, "{}{word}{version}", if at > 0 { ", " } else { "" })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_holds_when_every_part_holds() {
        let range: VersionRange = ">=1.0, <3".parse().expect("range");
        let version = |text: &str| text.parse::<Version>().expect("version");
        assert!(range.contains(version("1.0")) && range.contains(version("2.9.7")));
        assert!(!range.contains(version("3.0.0")) && !range.contains(version("0.9")));
        assert_eq!(range.to_string(), ">=1.0, <3.0");
    }

    #[test]
    fn nonsense_is_refused() {
        assert!("1.0".parse::<VersionRange>().is_err());
        assert!(">=x".parse::<VersionRange>().is_err());
        assert!("1.2.3.4".parse::<Version>().is_err());
    }
}

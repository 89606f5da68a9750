//! `watch`: judge live traffic.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::{BrokerArgs, Format, PageArgs, SuiteArgs};

const WATCH_HELP: &str = "\
Examples:
  vda5050-tck watch --broker mqtt://127.0.0.1:1883               until Ctrl-C
  vda5050-tck watch --record site.jsonl --rotate-every 1d --keep 14
  vda5050-tck watch --metrics 127.0.0.1:9464 --summary 15m       for a scraper and a log
  vda5050-tck watch --broker mqtt://site:1883 --listen 0.0.0.0:1884   vehicles connect here
  vda5050-tck watch --for 60s --fail-fast                        as a check after a change on site

It only listens: nothing is published. What a subscriber cannot see is judged only with --listen.
The exit code is that of `audit`: 1 when something is violated, 0 when nothing is.";

/// `watch`.
#[derive(Clone, Debug, Args)]
#[command(after_help = WATCH_HELP)]
pub struct Watch {
    /// Where to listen.
    #[command(flatten)]
    pub at: BrokerArgs,
    /// Be the tap: let vehicles connect here, hand all on to the broker, and judge their connections, too
    #[arg(long, value_name = "HOST:PORT")]
    pub listen: Option<String>,
    /// End after this time, such as 90s, 15m, 8h or 7d; without it, Ctrl-C ends it
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    pub time: Option<Duration>,
    /// End at the first violation
    #[arg(long)]
    pub fail_fast: bool,
    /// Serve findings, rates and reaction times at /metrics, as OpenMetrics text
    #[arg(long, value_name = "HOST:PORT")]
    pub metrics: Option<String>,
    /// The page for people.
    #[command(flatten)]
    pub page: PageArgs,
    /// Write a journal, which `audit` judges alike; a file that is there is renamed
    #[arg(long, value_name = "FILE", help_heading = "Recording")]
    pub record: Option<PathBuf>,
    /// Begin another file at this size, such as 500K, 100M or 2G
    #[arg(long, value_name = "SIZE", value_parser = size, requires = "record", help_heading = "Recording")]
    pub rotate_size: Option<u64>,
    /// Begin another file after this time, such as 1h or 1d
    #[arg(long, value_name = "TIME", value_parser = time, requires = "record", help_heading = "Recording")]
    pub rotate_every: Option<Duration>,
    /// Keep so many finished files of this watch, and remove older ones
    #[arg(long, value_name = "NUMBER", requires = "record", help_heading = "Recording")]
    pub keep: Option<usize>,
    /// Only this vehicle: its serial number, or manufacturer/number; may be repeated
    #[arg(long, value_name = "VEHICLE", help_heading = "Selection")]
    pub vehicle: Vec<String>,
    /// Only this monitor, or what decides this requirement; `state/*` names many; may be repeated
    #[arg(long, value_name = "NAME", help_heading = "Selection")]
    pub only: Vec<String>,
    /// How topics are built, with {serialNumber}, and {interface}, {majorVersion}, {manufacturer} and {topic} where they have them
    #[arg(long, value_name = "TEMPLATE", help_heading = "Selection")]
    pub topic_template: Option<String>,
    /// A line for every finding; otherwise the first of a kind, the tenth, the hundredth and so on
    #[arg(long, help_heading = "Output")]
    pub every: bool,
    /// A line for each vehicle, so often
    #[arg(long, value_name = "TIME", value_parser = time, help_heading = "Output")]
    pub summary: Option<Duration>,
    /// Plain lines, and no full-screen view where the output is a terminal
    #[arg(long, help_heading = "Output")]
    pub plain: bool,
    /// How results are written to standard output
    #[arg(long, value_enum, default_value_t, help_heading = "Output")]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

/// A number and a unit: `90s`, `15m`, `8h`, `7d`.
pub(super) fn time(text: &str) -> Result<Duration, String> {
    let wrong = || format!("`{text}` is no time; write 90s, 15m, 8h or 7d");
    let units = [("s", 1), ("m", 60), ("h", 3_600), ("d", 86_400)];
    let seconds = scaled(text, &units).ok_or_else(wrong)?;
    if seconds == 0 {
        return Err(wrong());
    }
    Ok(Duration::from_secs(seconds))
}

/// A number and a unit: `500K`, `100M`, `2G`.
fn size(text: &str) -> Result<u64, String> {
    let units = [("K", 1 << 10), ("M", 1 << 20), ("G", 1 << 30)];
    let bytes = scaled(text, &units).filter(|bytes| *bytes > 0);
    bytes.ok_or_else(|| format!("`{text}` is no size; write 500K, 100M or 2G"))
}

fn scaled(text: &str, units: &[(&str, u64)]) -> Option<u64> {
    let (number, unit) = units
        .iter()
        .find_map(|(name, unit)| Some((text.strip_suffix(name)?, unit)))?;
    number.parse::<u64>().ok()?.checked_mul(*unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_sizes_have_units() {
        assert_eq!(time("90s"), Ok(Duration::from_secs(90)));
        assert_eq!(time("7d"), Ok(Duration::from_secs(7 * 86_400)));
        assert_eq!(size("2G"), Ok(2 << 30));
        for wrong in [
            "",
            "s",
            "1",
            "0s",
            "-1s",
            "1.5h",
            "99999999999999999999d",
            "18446744073709551615d",
            "1ms",
        ] {
            assert!(time(wrong).is_err(), "{wrong}");
        }
        for wrong in ["1", "K", "0M", "1T"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}

//! `audit`: judge what was recorded.

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::{Format, SuiteArgs};
use tck_base::shard::Shard;

const AUDIT_HELP: &str = "\
Examples:
  vda5050-tck audit site.jsonl                               what mosquitto_sub -F %J or %j printed
  mosquitto_sub -v -t 'uagv/#' | vda5050-tck audit -         until it ends
  vda5050-tck audit monday.jsonl.gz tuesday.jsonl.zst        as one stream, ordered by time
  vda5050-tck audit site.pcap                                network traffic: QoS, last will and the like are judged, too
  vda5050-tck audit site.jsonl --slice STATE-12 > bug.jsonl  as few messages as still show a finding
  vda5050-tck audit tuesday.jsonl --baseline audits/monday   red only for what was not there on Monday
  vda5050-tck audit log.jsonl --time ts --topic t --payload p

What a recording cannot show is not judged: it may begin in the middle or lack messages.";

/// `audit`.
#[derive(Clone, Debug, Args)]
#[command(after_help = AUDIT_HELP)]
pub struct Audit {
    /// Recordings, packed with gzip or zstd or not; `-` is standard input
    #[arg(value_name = "CAPTURE", required = true)]
    pub captures: Vec<PathBuf>,
    /// The member that holds the time; a dot leads inside
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub time: Option<String>,
    /// The member that holds the topic
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub topic: Option<String>,
    /// The member that holds the payload: an object, a text, or base64
    #[arg(long, value_name = "MEMBER", help_heading = "Lines of another form")]
    pub payload: Option<String>,
    /// Leave out what was recorded before, such as 2026-01-31T08:00:00Z
    #[arg(long, value_name = "TIME", help_heading = "Selection")]
    pub from: Option<jiff::Timestamp>,
    /// Leave out what was recorded after
    #[arg(long, value_name = "TIME", help_heading = "Selection")]
    pub to: Option<jiff::Timestamp>,
    /// Only this vehicle: its serial number, or manufacturer/number; may be repeated
    #[arg(long, value_name = "VEHICLE", help_heading = "Selection")]
    pub vehicle: Vec<String>,
    /// Only this monitor, or what decides this requirement; `state/*` names many; may be repeated
    #[arg(long, value_name = "NAME", help_heading = "Selection")]
    pub only: Vec<String>,
    /// How topics are built, with {serialNumber}, and {interface}, {majorVersion}, {manufacturer} and {topic} where they have them
    #[arg(long, value_name = "TEMPLATE", help_heading = "Selection")]
    pub topic_template: Option<String>,
    /// Protocol version all are judged by; otherwise that which their messages name
    #[arg(long, value_name = "VERSION", help_heading = "Selection")]
    pub protocol: Option<String>,
    /// Write result.json, junit.xml, report.html and manifest.json into this folder, for `report --verify`, `--compare` and `--as`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Hold it against the bundle of an earlier audit, or its result.json: exit code 1 only for what is new; what is gone is said
    #[arg(long, value_name = "BUNDLE|FILE", conflicts_with_all = ["follow", "slice"])]
    pub baseline: Option<PathBuf>,
    /// Write messages and findings as Parquet into this folder: a table for each topic, and one of findings
    #[arg(long, value_name = "DIR")]
    pub export: Option<PathBuf>,
    /// Go on when the file ends, as long as it grows: each finding is a line, until Ctrl-C
    #[arg(long, conflicts_with_all = ["slice", "out", "export"])]
    pub follow: bool,
    /// Write the smallest journal that still shows a finding to standard output: the first one of this requirement or monitor
    #[arg(long, value_name = "FINDING")]
    pub slice: Option<String>,
    /// Leave out names of makers, vehicles, maps, nodes, orders and loads, free texts, and where on the floor something is
    #[arg(long, conflicts_with_all = ["vehicle", "follow"])]
    pub redact: bool,
    /// Cut each vehicle's time where it is at rest into stretches of this length at least, such as 6h, each judged by itself
    #[arg(long, value_name = "TIME", value_parser = super::watch::time, conflicts_with_all = ["follow", "slice", "export", "baseline"])]
    pub cut: Option<Duration>,
    /// Only part I of N of the vehicles (of the stretches with --cut), for several processes; `report --merge` joins the parts (docs/shards.md)
    #[arg(long, value_name = "I/N", conflicts_with_all = ["follow", "slice"])]
    pub shard: Option<Shard>,
    /// How results are written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Which suites.
    #[command(flatten)]
    pub suites: SuiteArgs,
}

//! A real scheduler: a Slurm of one node on this machine, run by whoever runs the test, whose array job does the parts.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::bench::{Bench, bundles};
use crate::cluster::Process;
use crate::mosquitto::free_port;
use crate::sharing::{read, said};

/// How long Slurm may take to be there, and then for its jobs.
const LIMIT: Duration = Duration::from_secs(300);
/// Faults that the selection finds, and some that it does not.
const FAULTS: [&str; 8] = [
    "outdated-update-taken-over",
    "outdated-update-silent",
    "outdated-update-misnamed",
    "outdated-update-fatal",
    "horizon-not-reported",
    "references-of-last-order",
    "pause-flag-missing",
    "unreadable-order-dropped",
];
/// Few tests, so that some parts of a run have nothing to do.
const TESTS: [&str; 3] = [
    "order-rejection/lower-update-id",
    "order-rejection/unreadable[truncated]",
    "instant-actions/factsheet-request",
];

/// A Slurm of this test's own. It is gone when the test is over.
struct Slurm {
    configuration: PathBuf,
    processes: [Process; 2],
    _folder: tempfile::TempDir,
}

impl Slurm {
    /// Starts one; `None` where the programs are not there, which in CI is a failure.
    fn start() -> Option<Self> {
        let begun = Instant::now();
        let user = Command::new("id").arg("-un").output().unwrap().stdout;
        let user = String::from_utf8(user).unwrap();
        // Ports are guessed, and another test may be faster, hence several tries.
        for _ in 0..3 {
            let folder = tempfile::tempdir().unwrap();
            let configuration = folder.path().join("slurm.conf");
            let at = folder.path().display();
            for name in ["state", "spool"] {
                fs::create_dir(folder.path().join(name)).unwrap();
            }
            // Without munge, since nobody else speaks to it; it believes in more processors than there are, so that parts
            // go on beside each other on any machine.
            let text = format!(
                "ClusterName=tck\nSlurmctldHost=localhost(127.0.0.1)\nSlurmctldPort={}\nSlurmdPort={}\nSlurmUser={user}\n\
                 SlurmdUser={user}\nAuthType=auth/none\nCredType=cred/none\nStateSaveLocation={at}/state\n\
                 SlurmdSpoolDir={at}/spool\nSlurmctldPidFile={at}/slurmctld.pid\nSlurmdPidFile={at}/slurmd.pid\n\
                 SlurmctldLogFile={at}/slurmctld.log\nSlurmdLogFile={at}/slurmd.log\nProctrackType=proctrack/pgid\n\
                 TaskPlugin=task/none\nJobAcctGatherType=jobacct_gather/none\nMpiDefault=none\n\
                 SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\nSchedulerType=sched/builtin\n\
                 SchedulerParameters=sched_interval=1,batch_sched_delay=0\nSlurmdParameters=config_overrides\n\
                 NodeName=bench NodeHostname=localhost NodeAddr=127.0.0.1 CPUs=2 RealMemory=1 State=UNKNOWN\n\
                 PartitionName=all Nodes=bench Default=YES MaxTime=INFINITE State=UP\n",
                free_port(),
                free_port(),
                user = user.trim(),
            );
            fs::write(&configuration, text).unwrap();
            fs::write(folder.path().join("cgroup.conf"), "").unwrap();
            let start = |program: &str, more: &[&str]| {
                let mut command = Command::new(program);
                Process::start(
                    command
                        .env("SLURM_CONF", &configuration)
                        .arg("-D")
                        .arg("-f")
                        .arg(&configuration)
                        .args(more),
                )
            };
            let processes = [start("slurmctld", &[])?, start("slurmd", &["-N", "bench"])?];
            let mut this = Self {
                configuration,
                processes,
                _folder: folder,
            };
            while begun.elapsed() < LIMIT && !this.processes.iter_mut().any(Process::has_ended) {
                let state = this.client("sinfo").args(["-h", "-o", "%t"]).output().unwrap();
                if state.stdout.starts_with(b"idle") {
                    return Some(this);
                }
                std::thread::sleep(Duration::from_millis(100));
            }
        }
        panic!("Slurm does not start");
    }

    /// One of the commands by which a user speaks to it.
    fn client(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.env("SLURM_CONF", &self.configuration);
        command
    }

    /// Runs a script of `deploy/` as a job in this folder, and waits for its end.
    fn run(&self, script: &str, bench: &Bench, variables: &[(&str, &str)]) {
        let tool = Path::new(env!("CARGO_BIN_EXE_vda5050-tck"));
        let path = format!(
            "{}:{}",
            tool.parent().unwrap().display(),
            std::env::var("PATH").unwrap()
        );
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy").join(script);
        let job = self
            .client("sbatch")
            .env_clear()
            .env("SLURM_CONF", &self.configuration)
            .env("PATH", path)
            .env("XDG_CONFIG_HOME", bench.path().join("no-settings"))
            .envs(variables.iter().copied())
            .args(["--wait", "--time=5"])
            .arg(format!("--chdir={}", bench.path().display()))
            .arg(script)
            .output()
            .unwrap();
        let said = || {
            let entries = fs::read_dir(bench.path()).unwrap().map(|entry| entry.unwrap().path());
            let texts = entries.filter(|path| path.extension().is_some_and(|extension| extension == "txt"));
            texts.map(|path| fs::read_to_string(path).unwrap()).collect::<String>()
        };
        assert!(job.status.success(), "{job:?}\n{}", said());
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // Jobs that a test which broke off has left do not end with their daemon.
        let _ = self
            .client("scancel")
            .args(["--full", "--signal=KILL", "--partition=all"])
            .status();
    }
}

/// A campaign of eight vehicles of which each has another fault, and one suite.
fn campaign() -> String {
    let device = |fault: &str| format!("[devices.{fault}]\narguments = [\"--virtual\", \"--fault\", \"{fault}\"]\n");
    let devices: String = FAULTS.iter().copied().map(device).collect();
    format!("{devices}[suites.few]\ntests = {TESTS:?}\narguments = [\"--seed\", \"7\"]\n")
}

/// The requirements that a result says are broken, and by what.
fn broken(result: &Value) -> Vec<(String, String)> {
    let all = result["requirements"].as_array().unwrap().iter();
    let broken = all.filter(|one| one["verdict"] == "fail");
    broken
        .map(|one| (one["id"].to_string(), one["decided_by"].to_string()))
        .collect()
}

#[test]
fn eight_tasks_of_an_array_job_of_slurm_are_joined_to_what_one_process_finds() {
    let Some(slurm) = Slurm::start() else { return };
    let bench = Bench::new();
    fs::write(bench.path().join("campaign.toml"), campaign()).unwrap();
    let named: Vec<&str> = FAULTS.iter().flat_map(|fault| ["--fault", fault]).collect();
    let asked = [&["--role", "agv", "--protocol", "2.1.0"], &named[..], &TESTS[..1]].concat();
    let qualify = asked.join(" ");
    let variables = [("CAMPAIGN", "campaign.toml"), ("QUALIFY", qualify.as_str())];
    slurm.run("slurm.sh", &bench, &variables);
    let task = fs::read_to_string(bench.path().join("part-3.txt")).unwrap();
    assert!(
        task.contains("part 3 of 8 is done here (Slurm, job array: SLURM_ARRAY_TASK_ID=3"),
        "{task}"
    );

    let own = Path::new(env!("CARGO_BIN_EXE_vda5050-tck"))
        .parent()
        .unwrap()
        .display()
        .to_string();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/slurm-merge.sh");
    let joined = Command::new("sh")
        .arg(script)
        .env("PATH", format!("{own}:{}", std::env::var("PATH").unwrap()))
        .current_dir(bench.path())
        .output()
        .unwrap();
    assert_eq!(joined.status.code(), Some(1), "the vehicles have faults: {joined:?}");

    bench.run(&[&["qualify", "--out", "one/qualification"], &asked[..]].concat());
    let mut whole = read(&bench.path().join("whole/qualification/result.json"));
    let merged = whole.as_object_mut().unwrap().remove("merged").unwrap();
    assert_eq!(merged.get("troubles"), None, "{merged:#}");
    assert_eq!(whole, read(&bench.path().join("one/qualification/result.json")));

    bench
        .run(&["campaign", "campaign.toml", "--out", "one/campaign"])
        .code(1);
    let mut failed = 0;
    for fault in FAULTS {
        let whole = read(&bench.path().join(format!("whole/{fault}/few/result.json")));
        assert_eq!(whole["merged"].get("troubles"), None, "{fault}");
        let reports = bench.path().join(format!("one/campaign/{fault}/few/reports"));
        let unsplit = read(&bundles(&reports)[0].join("result.json"));
        let ([verdict, tests, ..], [one_verdict, one_tests, ..]) = (said(&whole), said(&unsplit));
        assert_eq!((verdict, tests), (one_verdict, one_tests), "{fault}");
        // A monitor that puts together what came in several tests passes where they are together, and is open elsewhere.
        assert_eq!(broken(&whole), broken(&unsplit), "{fault}");
        failed += usize::from(whole["verdict"] == "fail");
    }
    assert!((2..FAULTS.len()).contains(&failed), "{failed} vehicles fail");
}

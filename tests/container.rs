//! The images of `Containerfile`: what a build needs is copied, and a pipeline finds in one of them what it needs.
#![allow(clippy::expect_used, reason = "a test may fail by panicking")]

use std::path::{Path, PathBuf};

/// The instructions of each stage, the last of which is built unless another one is named.
fn stages() -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(root().join("Containerfile")).expect("the file");
    let mut stages: Vec<Vec<String>> = Vec::new();
    for line in text.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        if line.starts_with("FROM ") {
            stages.push(Vec::new());
        }
        stages.last_mut().expect("FROM comes first").push(line.to_owned());
    }
    stages
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What is copied from the sources.
fn copied() -> Vec<String> {
    let all = stages().into_iter().flatten();
    let lines = all.filter_map(|line| line.strip_prefix("COPY ").map(str::to_owned));
    let lines = lines.filter(|line| !line.starts_with("--from"));
    lines
        .flat_map(|line| {
            let mut words: Vec<String> = line.split_whitespace().map(str::to_owned).collect();
            words.pop();
            words
        })
        .collect()
}

/// All Rust files below a folder that go into the program.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !matches!(name.as_str(), "tests" | "benches") {
            sources(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") && !name.ends_with("tests.rs") {
            found.push(path);
        }
    }
}

#[test]
fn what_the_program_is_built_of_is_copied() {
    let copied = copied();
    for path in &copied {
        assert!(root().join(path).exists(), "{path} is copied and is not there");
    }
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    sources(&root().join("crates"), &mut files);
    let mut included = 0;
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a source");
        let program = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        for part in program.split("include_str!(\"").skip(1) {
            let inside = part.split('"').next().unwrap_or_default();
            let path = file.parent().expect("a folder").join(inside);
            let path = path.canonicalize().expect("what is included is there");
            let path = path
                .strip_prefix(root().canonicalize().expect("the root"))
                .expect("inside");
            assert!(
                copied.iter().any(|folder| path.starts_with(folder)),
                "{} includes {}, which no COPY of the Containerfile has",
                file.display(),
                path.display()
            );
            included += 1;
        }
    }
    assert!(included > 1, "only {included} files are included");
}

#[test]
fn a_pipeline_has_a_shell_certificates_and_a_user_and_the_other_image_the_program_alone() {
    let stages = stages();
    let of = |name: &str| {
        let end = format!(" AS {name}");
        stages.iter().find(|stage| stage[0].ends_with(&end)).expect("the stage")
    };
    let pipeline = of("pipeline");
    let has = |stage: &[String], what: &str| stage.iter().any(|line| line.contains(what));
    assert!(!pipeline[0].contains("scratch"));
    assert!(has(pipeline, "ca-certificates"));
    let user = pipeline.iter().find_map(|line| line.strip_prefix("USER "));
    assert!(user.is_some_and(|user| !matches!(user, "root" | "0")), "{user:?}");
    // An entry point would swallow the shell with which a pipeline begins.
    assert!(!has(pipeline, "ENTRYPOINT"));
    let last = stages.last().expect("a stage");
    assert_eq!(last[0], "FROM scratch");
    assert!(has(last, "ENTRYPOINT"));
    for stage in [pipeline, last] {
        assert!(has(stage, "COPY --from=build /source/target/release/vda5050-tck "));
    }
}

/// What Containerfile says, with an empty base in the place of images from a registry, and a stand-in for the program that nobody
/// compiles here.
fn without_network() -> String {
    let stand_in = "COPY Containerfile /source/target/release/vda5050-tck";
    let lines = stages().into_iter().flatten().filter_map(|line| {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words.as_slice() {
            ["FROM", image, rest @ ..] if image.starts_with("docker.io/") => {
                Some(format!("FROM scratch {}", rest.join(" ")))
            }
            ["RUN", "cargo", "build", ..] => Some(stand_in.to_owned()),
            ["RUN", ..] => None,
            _ => Some(line),
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

#[test]
fn a_builder_finds_everything_and_makes_the_image_of_the_program_alone() {
    let Ok(version) = std::process::Command::new("buildah").arg("--version").output() else {
        assert!(std::env::var_os("CI").is_none(), "buildah is missing");
        eprintln!("buildah is missing, and no image is built");
        return;
    };
    assert!(version.status.success());
    let text = without_network();
    assert!(
        text.contains("FROM scratch AS build") && text.contains("release/vda5050-tck"),
        "{text}"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("Containerfile");
    std::fs::write(&file, text).expect("written");
    let buildah = |arguments: &[&str]| {
        let mut command = std::process::Command::new("buildah");
        command.arg("--root").arg(folder.path().join("root"));
        command.arg("--runroot").arg(folder.path().join("run"));
        let ended = command.args(["--storage-driver", "vfs"]).args(arguments).output();
        let ended = ended.expect("buildah runs");
        let said = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert!(ended.status.success(), "{arguments:?}: {said}");
        ended.stdout
    };
    let (file, context) = (file.display().to_string(), root().display().to_string());
    buildah(&[
        "bud",
        "--isolation",
        "chroot",
        "--file",
        &file,
        "--tag",
        "alone",
        &context,
    ]);
    let image: serde_json::Value =
        serde_json::from_slice(&buildah(&["inspect", "--type", "image", "alone"])).expect("an image");
    let config = &image["OCIv1"]["config"];
    assert_eq!(config["Entrypoint"], serde_json::json!(["/usr/bin/vda5050-tck"]));
    assert_eq!(config["Cmd"], serde_json::json!(["--help"]));
    assert_eq!(config["WorkingDir"], "/work");
}

//! What a run is written as for a pipeline.

use std::path::PathBuf;

use clap::ValueEnum;

/// What a run is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Rendering {
    /// JUnit XML with a case for each test and monitor
    Junit,
    /// JUnit XML with a case for each requirement
    JunitRequirements,
    /// JUnit XML with properties, and the keys of Xray and `TestRail`
    JunitProperties,
    /// Common Test Report Format
    Ctrf,
    /// Results of Allure, in a folder
    Allure,
    /// Markdown, such as for the summary page of a step
    Markdown,
    /// Code quality of GitLab
    CodeQuality,
    /// SARIF 2.1.0
    Sarif,
    /// Attestations of `CycloneDX`
    Cyclonedx,
    /// A simple verification result of in-toto
    Svr,
}

/// A rendering, and the file that it goes into.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RenderedTo {
    /// What it is written as.
    pub rendering: Rendering,
    /// The file, or the folder of several; standard output without one.
    pub file: Option<PathBuf>,
}

impl RenderedTo {
    /// Whether what is named as its file is something else, such as a pipe.
    #[must_use]
    pub fn is_stream(&self) -> bool {
        let facts = self.file.as_ref().and_then(|file| std::fs::metadata(file).ok());
        facts.is_some_and(|facts| !facts.is_file() && !facts.is_dir())
    }
}

/// `KIND=FILE`.
pub(in crate::cli) fn to_file(text: &str) -> Result<RenderedTo, String> {
    let wanted = to_file_or_stdout(text)?;
    match wanted.file {
        Some(file) if file.as_os_str() == "-" => {
            Err("standard output belongs to the run; `report --as` prints there".to_owned())
        }
        Some(_) => Ok(wanted),
        None => Err(format!("a kind and a file are written like `{text}=FILE`")),
    }
}

/// `KIND`, or `KIND=FILE`.
pub(super) fn to_file_or_stdout(text: &str) -> Result<RenderedTo, String> {
    let (kind, file) = match text.split_once('=') {
        Some((_, "")) => return Err(format!("after `{text}` the name of a file is missing")),
        Some((kind, file)) => (kind, Some(PathBuf::from(file))),
        None => (text, None),
    };
    let rendering = Rendering::from_str(kind, false).map_err(|_| {
        let all = Rendering::value_variants()
            .iter()
            .filter_map(ValueEnum::to_possible_value);
        let all: Vec<String> = all.map(|value| value.get_name().to_owned()).collect();
        format!("there is no `{kind}`; there are {}", all.join(", "))
    })?;
    if rendering == Rendering::Allure && file.is_none() {
        return Err("results of Allure are a folder of files, written like `allure=FOLDER`".to_owned());
    }
    Ok(RenderedTo { rendering, file })
}

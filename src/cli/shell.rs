//! `completions` and `man`: completions for shells, and manual pages, from the command line itself.

use std::path::Path;

use clap::CommandFactory as _;

use super::args::{Cli, Completions, Man};
use super::exit::Exit;
use super::problem::Problem;

/// `completions`.
pub fn completions(arguments: &Completions) -> Result<Exit, Problem> {
    let mut command = Cli::command();
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, name, &mut script);
    super::print(&String::from_utf8_lossy(&script))
}

/// `man`.
pub fn man(arguments: &Man) -> Result<Exit, Problem> {
    let mut command = Cli::command();
    command.build();
    let Some(folder) = &arguments.dir else {
        let name = command.get_name().to_owned();
        return super::print(&page(command, &name)?);
    };
    std::fs::create_dir_all(folder).map_err(|error| unwritable(folder, &error))?;
    pages(&command, command.get_name().to_owned(), folder)?;
    Ok(Exit::Conforms)
}

/// Writes the page of a command and those of the commands below it.
fn pages(command: &clap::Command, name: String, folder: &Path) -> Result<(), Problem> {
    for below in command.get_subcommands() {
        pages(below, format!("{name}-{}", below.get_name()), folder)?;
    }
    let file = folder.join(format!("{name}.1"));
    let page = page(command.clone(), &name)?;
    std::fs::write(&file, page).map_err(|error| unwritable(&file, &error))
}

fn page(command: clap::Command, name: &str) -> Result<String, Problem> {
    let mut page = Vec::new();
    let rendered = clap_mangen::Man::new(command).title(name).render(&mut page);
    rendered.map_err(|error| Problem::Environment(format!("cannot make the manual page: {error}")))?;
    Ok(String::from_utf8_lossy(&page).into_owned())
}

fn unwritable(path: &Path, error: &std::io::Error) -> Problem {
    Problem::Environment(format!("cannot write {}: {error}", path.display()))
}

//! Which part of something is done, where several processes share it: said in the first line, because it may be a surprise.

use tck_base::diagnostic::Diagnostic;
use tck_base::shard::{self, ChosenShard, Shard};
use tck_profile::Surroundings;

use super::problem::Problem;

/// The part that the flag or a scheduler says; `None` is all of it. It is told.
///
/// # Errors
/// When a scheduler has begun to say a part, and it is not clear which.
pub(super) fn chosen(flag: Option<Shard>, surroundings: &Surroundings) -> Result<Option<ChosenShard>, Problem> {
    let chosen = shard::chosen(flag, &surroundings.environment).map_err(|error| {
        let hint = "`--shard I/N` says which part is meant, and `--shard 1/1` that all of it is; see docs/shards.md";
        Problem::from(Diagnostic::whole("shard", error.to_string()).hint(hint))
    })?;
    if let Some(ChosenShard { shard, origin }) = &chosen {
        let Shard { index, of } = shard;
        let how = match flag {
            Some(_) => String::new(),
            None => "; `--shard 1/1` does all of it".to_owned(),
        };
        super::tell(&format!("part {index} of {of} is done here ({origin}){how}"));
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use tck_base::shard::{SCHEDULERS, Scheduler};

    #[test]
    fn the_documentation_shows_the_table_of_schedulers_as_it_is() {
        let page = include_str!("../../docs/shards.md");
        let begin = page.find("| scheduler |").expect("a table");
        let table: Vec<&str> = page[begin..]
            .lines()
            .skip(2)
            .take_while(|line| line.starts_with('|'))
            .collect();
        let rows: Vec<String> = SCHEDULERS.iter().map(Scheduler::row).collect();
        assert_eq!(table, rows);
    }
}

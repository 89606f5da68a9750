//! A conversation that fails, made as short as it goes.

use super::chain::Chain;
use super::grammar::Grammar;

/// The shortest chain that was found which still fails, within `budget` trials. What the grammar does not allow is not
/// tried.
///
/// # Errors
/// What `fails` reports.
pub fn shrink<E>(
    grammar: &Grammar,
    chain: &Chain,
    budget: usize,
    mut fails: impl FnMut(&Chain) -> Result<bool, E>,
) -> Result<Chain, E> {
    let mut best = chain.clone();
    let mut left = budget;
    let mut holds = |candidate: &Chain, best: &mut Chain, left: &mut usize| -> Result<bool, E> {
        if *left == 0 || candidate.stimuli().len() >= best.stimuli().len() {
            return Ok(false);
        }
        *left -= 1;
        let fails = fails(candidate)?;
        if fails {
            *best = candidate.clone();
        }
        Ok(fails)
    };
    if let Some(direct) = best.stimuli().last().and_then(|last| Chain::shortest_to(grammar, last)) {
        holds(&direct, &mut best, &mut left)?;
    }
    let mut size = best.stimuli().len() / 2;
    while size > 0 && left > 0 {
        let mut from = 0;
        let mut shorter = false;
        while from < best.stimuli().len() {
            let until = (from + size).min(best.stimuli().len());
            let rest = [&best.stimuli()[..from], &best.stimuli()[until..]].concat();
            let candidate = Chain::of(grammar, &rest).filter(|candidate| !candidate.stimuli().is_empty());
            match candidate {
                Some(candidate) if holds(&candidate, &mut best, &mut left)? => shorter = true,
                _ => from += 1,
            }
        }
        // Once nothing can be left out, larger pieces are not tried again: what became of them is known.
        if !shorter {
            size /= 2;
        }
    }
    Ok(best)
}

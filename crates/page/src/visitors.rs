//! Who looks at the page: only so many at a time, and a page that comes again takes its old place.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::watch;

/// How many pages are open at a time.
pub(crate) const VISITORS: usize = 16;
/// How long the name may be that a page gives itself.
const LONGEST_NAME: usize = 64;

/// All who look. Copies are the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Visitors(Arc<Mutex<State>>);

#[derive(Debug, Default)]
struct State {
    came: u64,
    /// By the name that the page gives itself: number of the visit, and what ends it.
    here: BTreeMap<String, (u64, watch::Sender<bool>)>,
}

/// One who looks, until it is dropped.
#[derive(Debug)]
pub(crate) struct Visit {
    name: String,
    number: u64,
    replaced: watch::Receiver<bool>,
    visitors: Visitors,
}

impl Visitors {
    /// Lets a page in that calls itself `name`. It takes the place of its own older connection, which may be dead without
    /// anybody having noticed. `None` when all places are taken by others.
    pub fn enter(&self, name: &str) -> Option<Visit> {
        let name: String = name.chars().take(LONGEST_NAME).collect();
        let mut state = self.state();
        if !state.here.contains_key(&name) && state.here.len() >= VISITORS {
            return None;
        }
        state.came += 1;
        let number = state.came;
        let (ends, replaced) = watch::channel(false);
        if let Some((_, older)) = state.here.insert(name.clone(), (number, ends)) {
            older.send_replace(true);
        }
        Some(Visit {
            name,
            number,
            replaced,
            visitors: self.clone(),
        })
    }

    /// How many are there.
    pub fn count(&self) -> usize {
        self.state().here.len()
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Visit {
    /// Ends when the page has come again.
    pub async fn is_replaced(&mut self) {
        let _ = self.replaced.wait_for(|replaced| *replaced).await;
    }
}

impl Drop for Visit {
    fn drop(&mut self) {
        let mut state = self.visitors.state();
        let is_own = state
            .here
            .get(&self.name)
            .is_some_and(|(number, _)| *number == self.number);
        if is_own {
            state.here.remove(&self.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn only_so_many_look_and_who_comes_again_is_let_in() {
        let visitors = Visitors::default();
        let mut all: Vec<Visit> = (0..VISITORS)
            .filter_map(|number| visitors.enter(&number.to_string()))
            .collect();
        assert_eq!((all.len(), visitors.count()), (VISITORS, VISITORS));
        assert!(visitors.enter("one more").is_none());
        let again = visitors.enter("3").expect("its own place");
        all[3].is_replaced().await;
        drop(all.remove(3));
        assert_eq!(visitors.count(), VISITORS, "the older visit has no place any more");
        drop(again);
        assert_eq!(visitors.count(), VISITORS - 1);
        assert!(
            visitors
                .enter(&"long".repeat(99))
                .is_some_and(|visit| visit.name.len() == LONGEST_NAME)
        );
    }
}

//! What a master control declines to do: where it must send nothing, to say so is an answer. What has to come of it later is asked
//! for once more when it is awaited.

use tck_pack::{Pack, Role};
use tck_suite::model::{Operator, Step, Test, Verb};

/// What a test awaits of the master control under test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaits {
    /// That nothing comes.
    Nothing,
    /// That something comes.
    Something,
}

impl Awaits {
    /// What a step awaits of a master control. What mock vehicles say themselves does not count.
    fn of(step: &Step, pack: &Pack) -> Option<Self> {
        let is_own = |topic: &str| {
            let rule = pack.topic(topic);
            rule.is_none_or(|rule| rule.publisher == Role::MasterControl)
        };
        match &*step.verb {
            Verb::Never(never) if is_own(&never.topic) => Some(Self::Nothing),
            Verb::Expect(expect) if is_own(&expect.topic) => Some(Self::Something),
            Verb::Always(always) if is_own(&always.topic) => Some(Self::Something),
            Verb::Retained(retained) if is_own(&retained.topic) => Some(Self::Something),
            Verb::Action(_) => Some(Self::Something),
            _ => None,
        }
    }
}

/// Whether that the hook of a step is declined leaves open what a test decides: something is awaited of a master control behind it,
/// be it that nothing comes. In a conversation it ends what was asked for.
pub(super) fn is_an_answer(step: &Step, test: &Test, pack: &Pack) -> bool {
    let mut behind = test.steps.iter().skip_while(|other| other.path != step.path).skip(1);
    test.device == Role::MasterControl
        && test.goes_on_at(&step.path).is_none()
        && behind.find_map(|step| Awaits::of(step, pack)).is_some()
}

/// What was declined, and why.
#[derive(Debug, Default)]
pub(super) struct Declined(Option<(Operator, String)>);

impl Declined {
    /// What the hook of a step asks for is declined.
    pub(super) fn says(&mut self, step: &Step, why: &str) {
        if let Verb::Operator(operator) = &*step.verb {
            self.0 = Some((operator.clone(), why.to_owned()));
        }
    }

    /// A hook was run well: by this step, or by one that awaits something and has it asked for once more.
    pub(super) fn does(&mut self, hook: &str, step: &Step) {
        let by = match &*step.verb {
            Verb::Operator(operator) => Some(vehicle(operator)),
            _ => None,
        };
        self.0
            .take_if(|(declined, _)| declined.hook == hook && by.is_none_or(|by| by == vehicle(declined)));
    }

    /// What has to be asked for once more before this step can await what it does, and why it was declined.
    pub(super) fn before(&self, step: &Step, pack: &Pack) -> Option<&(Operator, String)> {
        let declined = self.0.as_ref()?;
        (Awaits::of(step, pack) == Some(Awaits::Something)).then_some(declined)
    }
}

/// The variables that say which vehicle is meant; none for the first one.
fn vehicle(operator: &Operator) -> Vec<&str> {
    let named = operator.with.iter().find(|(name, _)| name == "vehicle");
    named.map_or_else(Vec::new, |(_, term)| term.variables())
}

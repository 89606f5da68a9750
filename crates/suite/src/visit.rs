//! Walking over every value of a step, so that no rule about values has to know the verbs.

use super::model::{CheckUse, Extent, Patch, Raw, Selection, SendAction, Step, Verb};
use tck_base::pattern::Term;

impl Step {
    /// Calls `visit` with every term of this step, in the order they are used.
    pub fn visit_terms<'a>(&'a self, visit: &mut dyn FnMut(&'a Term)) {
        match &*self.verb {
            Verb::Send(send) => {
                if let Some(route) = &send.route {
                    route
                        .actions
                        .iter()
                        .flat_map(|(_, actions)| actions)
                        .for_each(|a| action(a, visit));
                }
                send.actions.iter().for_each(|a| action(a, visit));
                send.payload.iter().for_each(&mut *visit);
                match &send.patch {
                    Some(Patch::Merge(term) | Patch::Operations(term)) => visit(term),
                    None => {}
                }
                if let Some(Raw::Text(term)) = &send.raw {
                    visit(term);
                }
            }
            Verb::Expect(step) => {
                selection(&step.selection, visit);
                visit(&step.within.term);
                for assertion in step.assert.iter().chain(&step.prefer) {
                    selection(&assertion.selection, visit);
                }
            }
            Verb::Never(step) => {
                selection(&step.selection, visit);
                visit(&step.during.term);
            }
            Verb::Always(step) => {
                selection(&step.selection, visit);
                match &step.extent {
                    Extent::During(time) => visit(&time.term),
                    Extent::Until(until) => {
                        selection(&until.selection, visit);
                        visit(&until.within.term);
                    }
                }
            }
            Verb::Action(step) => visit(&step.within.term),
            Verb::Retained(step) => {
                selection(&step.selection, visit);
                visit(&step.within.term);
                for assertion in &step.assert {
                    selection(&assertion.selection, visit);
                }
            }
            Verb::Link(_) => {}
            Verb::Serve(step) => step.file.iter().for_each(visit),
            Verb::Operator(step) => {
                step.with.iter().for_each(|(_, term)| visit(term));
                step.within.iter().for_each(|time| visit(&time.term));
            }
            Verb::Vehicle(step) => step.with.iter().for_each(|(_, term)| visit(term)),
        }
    }
}

fn action<'a>(action: &'a SendAction, visit: &mut dyn FnMut(&'a Term)) {
    visit(&action.action);
    action.with.iter().for_each(|(_, term)| visit(term));
    action.with_all.iter().for_each(&mut *visit);
    action.blocking.iter().for_each(visit);
}

fn selection<'a>(selection: &'a Selection, visit: &mut dyn FnMut(&'a Term)) {
    if let Some(pattern) = &selection.pattern {
        pattern.visit_terms(visit);
    }
    if let Some(check) = &selection.check {
        check.visit_terms(visit);
    }
}

impl CheckUse {
    /// Calls `visit` with every argument.
    pub fn visit_terms<'a>(&'a self, visit: &mut dyn FnMut(&'a Term)) {
        self.with.iter().for_each(|(_, term)| visit(term));
    }
}

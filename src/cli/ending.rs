//! Who wants a run to end: once in good order, twice at once, and then without a word.

use tokio::sync::watch;

use super::exit::Exit;
use super::problem::Problem;
use super::signals::Signals;
use crate::ui::{Prompter, put_terminal_back};
use tck_run::ENDS_WITHIN;

/// Two wishes about the end of a run, and the desk where they are answered.
pub(super) struct Ending {
    /// Where a person is asked, and can end the run, too.
    pub(super) desk: Prompter,
    /// Turns true when the run is to end in good order.
    pub(super) interrupt: watch::Receiver<bool>,
    /// Turns true when it is to end at once; its report is still written.
    pub(super) quit: watch::Receiver<bool>,
}

impl Ending {
    /// Listens for Ctrl-C and other signals that ask a program to end.
    pub(super) fn listen() -> Result<Self, Problem> {
        let (stop, interrupt) = watch::channel(false);
        let (quits, quit) = watch::channel(false);
        let desk = Prompter::new(stop.clone());
        let mut signals = Signals::listen()?;
        let said = desk.clone();
        tokio::spawn(async move {
            let mut stopped = stop.subscribe();
            tokio::select! {
                () = signals.next() => {}
                _ = stopped.wait_for(|stopped| *stopped) => {}
            }
            stop.send_replace(true);
            said.say(&format!(
                "ending in good order, up to {} s; Ctrl-C again quits at once, and still writes the report",
                ENDS_WITHIN.as_secs()
            ));
            signals.next().await;
            quits.send_replace(true);
            said.say("quitting: the report is written");
            signals.next().await;
            exit();
        });
        Ok(Self { desk, interrupt, quit })
    }
}

/// A signal once ends what goes on in good order, twice at once.
pub(super) fn interrupts() -> Result<watch::Receiver<bool>, Problem> {
    Ok(stop()?.subscribe())
}

/// What ends something in good order: a signal, or whoever has this. A second signal ends it at once.
pub(super) fn stop() -> Result<watch::Sender<bool>, Problem> {
    let (sender, mut stopped) = watch::channel(false);
    let mut signals = Signals::listen()?;
    let stop = sender.clone();
    tokio::spawn(async move {
        tokio::select! {
            () = signals.next() => {}
            _ = stopped.wait_for(|stopped| *stopped) => {}
        }
        stop.send_replace(true);
        signals.next().await;
        exit();
    });
    Ok(sender)
}

fn exit() -> ! {
    put_terminal_back();
    std::process::exit(i32::from(Exit::Interrupted.code()));
}

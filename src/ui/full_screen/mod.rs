//! A watch on the whole screen: vehicles, what was found of the chosen one, and the message with the wrong member marked.

mod marked;
mod view;

use std::io;
use std::time::Duration;

use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

use super::keyboard::typed;
use tck_watch::alarm::Alarmed;
use tck_watch::session::{Contact, Happening, Viewer};
use tck_watch::{Notice, Watch};
use view::{Focus, View};

/// A watch on the whole screen: vehicles, what was found of the chosen one, and the message with the wrong member
/// marked.
pub struct FullScreen {
    terminal: DefaultTerminal,
    view: View,
}

impl FullScreen {
    /// Takes the terminal over.
    ///
    /// # Errors
    /// What the terminal cannot do.
    pub fn open(broker: String) -> io::Result<Self> {
        Ok(Self {
            terminal: ratatui::try_init()?,
            view: View::new(broker),
        })
    }
}

impl Drop for FullScreen {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

impl Viewer for FullScreen {
    fn found(&mut self, _: &Notice) {}

    fn happened(&mut self, happening: &Happening, at: jiff::Timestamp) {
        self.view.note = match happening {
            Happening::Tap(address) => format!("vehicles are expected at mqtt://{address}"),
            Happening::Metrics(address) => format!("metrics at http://{address}/metrics"),
            Happening::Connected => String::new(),
            Happening::Again(unseen) => {
                format!("{at:.0} connected again; {:.1} s were not seen", unseen.as_secs_f64())
            }
            Happening::Lost(why) => format!("{at:.0} the connection is lost: {why}"),
            Happening::NotRecorded(why) => format!("{at:.0} nothing is recorded any more: {why}"),
        };
    }

    fn alarmed(&mut self, alarmed: &Alarmed) {
        let Alarmed {
            manufacturer,
            serial_number,
            at,
            alarm,
        } = alarmed;
        self.view.note = format!("{at:.0} {manufacturer} {serial_number}: {alarm}");
    }

    fn tick(&mut self, watch: &Watch<'_>, contact: Contact) -> bool {
        let glances = watch.worst_first();
        loop {
            match typed(Duration::ZERO) {
                Ok(None) => break,
                Ok(Some(Event::Key(key))) if key.kind != KeyEventKind::Release => {
                    if !press(&mut self.view, key) {
                        return false;
                    }
                }
                Ok(Some(_)) => {}
                Err(_) => return false,
            }
        }
        self.view.choose(&glances);
        let view = &mut self.view;
        self.terminal.draw(|frame| view.draw(frame, &glances, contact)).is_ok()
    }
}

/// What a key does; `false` ends the watch.
fn press(view: &mut View, key: KeyEvent) -> bool {
    let is_interrupt = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    match key.code {
        KeyCode::Char('q') => return false,
        _ if is_interrupt => return false,
        KeyCode::Tab | KeyCode::Left | KeyCode::Right => {
            view.focus = match view.focus {
                Focus::Vehicles => Focus::Findings,
                Focus::Findings => Focus::Vehicles,
            };
        }
        KeyCode::Up | KeyCode::Char('k') => view.step(-1),
        KeyCode::Down | KeyCode::Char('j') => view.step(1),
        KeyCode::PageUp => view.scroll(-10),
        KeyCode::PageDown => view.scroll(10),
        _ => {}
    }
    true
}

#[cfg(test)]
mod tests;

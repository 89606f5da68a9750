//! What is where on the screen.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span, Text};
use ratatui::widgets::{Block, Cell, Paragraph, Row, Table, TableState};

use super::marked;
use tck_base::verdict::Verdict;
use tck_report::clean::{line, short};
use tck_watch::session::Contact;
use tck_watch::vehicle_status::{Kind, VehicleStatus};

/// Which list the keys move in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Focus {
    Vehicles,
    Findings,
}

/// What is where on the screen.
pub(super) struct View {
    broker: String,
    pub note: String,
    pub focus: Focus,
    vehicle: usize,
    /// Manufacturer and serial number of the vehicle that somebody has chosen; until then it is the worst.
    chosen: Option<(String, String)>,
    /// Whether somebody has just chosen another one.
    chooses: bool,
    finding: usize,
    /// Lines the message is moved up, beside what shows the mark.
    moved: i32,
}

impl View {
    pub fn new(broker: String) -> Self {
        Self {
            broker,
            note: String::new(),
            focus: Focus::Vehicles,
            vehicle: 0,
            chosen: None,
            chooses: false,
            finding: 0,
            moved: 0,
        }
    }

    /// Moves the choice.
    pub fn step(&mut self, by: isize) {
        self.moved = 0;
        match self.focus {
            Focus::Vehicles => {
                self.vehicle = self.vehicle.saturating_add_signed(by);
                self.chooses = true;
                self.finding = 0;
            }
            Focus::Findings => self.finding = self.finding.saturating_add_signed(by),
        }
    }

    /// Moves the message.
    pub fn scroll(&mut self, by: i32) {
        self.moved = self.moved.saturating_add(by);
    }

    /// Keeps the choice among what there is.
    pub fn choose(&mut self, glances: &[&VehicleStatus]) {
        self.vehicle = self.vehicle.min(glances.len().saturating_sub(1));
        if std::mem::take(&mut self.chooses) {
            let chosen = glances.get(self.vehicle);
            self.chosen = chosen.map(|glance| (glance.manufacturer.clone(), glance.serial_number.clone()));
        } else if let Some((manufacturer, serial_number)) = &self.chosen {
            // Others may have moved past it since.
            let is_chosen = |glance: &&VehicleStatus| {
                glance.manufacturer == *manufacturer && glance.serial_number == *serial_number
            };
            self.vehicle = glances.iter().position(is_chosen).unwrap_or(self.vehicle);
        }
        let kinds = glances.get(self.vehicle).map_or(0, |glance| glance.kinds.len());
        self.finding = self.finding.min(kinds.saturating_sub(1));
    }

    pub fn draw(&mut self, frame: &mut Frame<'_>, glances: &[&VehicleStatus], contact: Contact) {
        let [top, vehicles, findings, detail, bottom] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Ratio(1, 4),
            Constraint::Ratio(1, 4),
            Constraint::Fill(1),
            Constraint::Length(1),
        ])
        .areas(frame.area());
        frame.render_widget(Paragraph::new(self.title(glances, contact)), top);
        self.vehicles(frame, vehicles, glances);
        let chosen = glances.get(self.vehicle).copied();
        let mut kinds: Vec<&Kind> = chosen.into_iter().flat_map(|glance| glance.kinds.values()).collect();
        kinds.sort_by_key(|kind| std::cmp::Reverse(kind.verdict));
        self.findings(frame, findings, &kinds);
        self.detail(frame, detail, chosen, kinds.get(self.finding).copied());
        let keys = "Up/Down choose   Tab other list   PgUp/PgDn move the message   q ends";
        frame.render_widget(
            Paragraph::new(keys).style(Style::new().add_modifier(Modifier::DIM)),
            bottom,
        );
    }

    fn title(&self, glances: &[&VehicleStatus], contact: Contact) -> Line<'static> {
        let messages: u64 = glances.iter().flat_map(|glance| glance.messages.values()).sum();
        let kinds = |verdict: Verdict| glances.iter().map(|glance| glance.found(verdict)).sum::<usize>();
        let mut spans = vec![Span::styled(
            format!("watch {}", line(&self.broker)),
            Style::new().add_modifier(Modifier::BOLD),
        )];
        spans.push(if contact.connected {
            Span::raw("  connected")
        } else {
            Span::styled("  NOT CONNECTED", style(Verdict::Fail))
        });
        spans.push(Span::raw(format!(
            "  {} vehicles, {messages} messages, {} violations, {} warnings  {}",
            glances.len(),
            kinds(Verdict::Fail),
            kinds(Verdict::Warning),
            short(&line(&self.note), 200)
        )));
        Line::from(spans)
    }

    fn vehicles(&self, frame: &mut Frame<'_>, area: Rect, glances: &[&VehicleStatus]) {
        // Only what is shown is made ready: there may be thousands.
        let height = usize::from(area.height.saturating_sub(3)).max(1);
        let first = self.vehicle.saturating_sub(height - 1);
        let shown = glances.iter().skip(first).take(height);
        let rows = shown.map(|glance| {
            let known = |text: &Option<String>| line(text.as_deref().unwrap_or("-")).into_owned();
            let order = glance.order.as_ref();
            let worst = [Verdict::Fail, Verdict::Warning]
                .into_iter()
                .find(|verdict| glance.found(*verdict) > 0);
            let found = format!("{}/{}", glance.found(Verdict::Fail), glance.found(Verdict::Warning));
            Row::new(vec![
                Cell::from(format!(
                    "{} {}",
                    line(&glance.manufacturer),
                    line(&glance.serial_number)
                )),
                Cell::from(known(&glance.version)),
                Cell::from(known(&glance.connection)),
                Cell::from(known(&glance.mode)),
                Cell::from(order.map_or("-".to_owned(), |(id, update)| format!("{}/{update}", line(id)))),
                Cell::from(format!("{}+{}", glance.nodes.0, glance.nodes.1)),
                Cell::from(known(&glance.last_node)),
                Cell::from(glance.charge.map_or("-".to_owned(), |charge| format!("{charge:.0}%"))),
                Cell::from(glance.errors.len().to_string()),
                Cell::from(found).style(worst.map_or(Style::new(), style)),
            ])
        });
        let widths = [
            Constraint::Min(16),
            Constraint::Length(7),
            Constraint::Length(16),
            Constraint::Length(13),
            Constraint::Min(10),
            Constraint::Length(6),
            Constraint::Min(8),
            Constraint::Length(5),
            Constraint::Length(6),
            Constraint::Length(9),
        ];
        let names = [
            "vehicle",
            "VDA",
            "connection",
            "mode",
            "order",
            "nodes",
            "last node",
            "charge",
            "errors",
            "findings",
        ];
        let table = self.list(
            Table::new(rows, widths).header(header(&names)),
            "Vehicles",
            Focus::Vehicles,
        );
        let mut state = TableState::new().with_selected(Some(self.vehicle - first));
        frame.render_stateful_widget(table, area, &mut state);
    }

    fn findings(&self, frame: &mut Frame<'_>, area: Rect, kinds: &[&Kind]) {
        let rows = kinds.iter().map(|kind| {
            let word = if kind.verdict == Verdict::Fail { "FAIL" } else { "WARN" };
            Row::new(vec![
                Cell::from(word).style(style(kind.verdict)),
                Cell::from(kind.requirement.clone()),
                Cell::from(crate::ui::watching::side(&kind.role)),
                Cell::from(kind.count.to_string()),
                Cell::from(kind.last.clone()),
                Cell::from(short(&line(&kind.text), 200).into_owned()),
            ])
        });
        let widths = [
            Constraint::Length(4),
            Constraint::Length(14),
            Constraint::Length(14),
            Constraint::Length(7),
            Constraint::Length(24),
            Constraint::Fill(1),
        ];
        let names = ["", "requirement", "side", "times", "last", "what"];
        let table = self.list(
            Table::new(rows, widths).header(header(&names)),
            "Findings",
            Focus::Findings,
        );
        let mut state = TableState::new().with_selected((!kinds.is_empty()).then_some(self.finding));
        frame.render_stateful_widget(table, area, &mut state);
    }

    fn list<'t>(&self, table: Table<'t>, title: &'static str, focus: Focus) -> Table<'t> {
        let mut border = Style::new();
        if self.focus == focus {
            border = border.fg(Color::Cyan);
        }
        table
            .block(Block::bordered().title(title).border_style(border))
            .row_highlight_style(Style::new().add_modifier(Modifier::REVERSED))
    }

    /// The chosen finding with its message; without one, the last state.
    fn detail(&self, frame: &mut Frame<'_>, area: Rect, glance: Option<&VehicleStatus>, kind: Option<&Kind>) {
        let height = usize::from(area.height.saturating_sub(2));
        let (title, mut lines, message) = match (kind, glance) {
            (Some(kind), _) => {
                let lines = vec![
                    Line::styled(
                        format!("{} {}: {}", kind.requirement, kind.monitor, line(&kind.text)),
                        style(kind.verdict),
                    ),
                    Line::raw(format!(
                        "first {}, last {}, {} times",
                        kind.first, kind.last, kind.count
                    )),
                ];
                let message = kind.message.as_ref().map(|(topic, payload)| {
                    let lines = marked::lines(payload, topic, &kind.text);
                    (line(topic).into_owned(), lines)
                });
                match message {
                    Some((topic, message)) => (topic, lines, message),
                    None => ("the message is not kept".to_owned(), lines, Vec::new()),
                }
            }
            (None, Some(glance)) => {
                let state = glance.state.as_deref().unwrap_or_default();
                let lines = vec![Line::raw("nothing was found; the last state:")];
                ("state".to_owned(), lines, marked::lines(state, "state", ""))
            }
            (None, None) => {
                let lines = vec![Line::raw("no vehicle was heard so far")];
                (String::new(), lines, Vec::new())
            }
        };
        let room = height.saturating_sub(lines.len()).max(1);
        let mark = message.iter().position(|line| line.is_marked).unwrap_or_default();
        let wanted = mark.saturating_sub(room / 2);
        let last = message.len().saturating_sub(room);
        let by = isize::try_from(self.moved).unwrap_or_default();
        let first = wanted.min(last).saturating_add_signed(by).min(last);
        lines.extend(message.into_iter().skip(first).take(room).map(|line| {
            if line.is_marked {
                let text = format!(">> {}", line.text);
                return Line::styled(text, style(Verdict::Fail).add_modifier(Modifier::REVERSED));
            }
            Line::raw(format!("   {}", line.text))
        }));
        frame.render_widget(
            Paragraph::new(Text::from(lines)).block(Block::bordered().title(title)),
            area,
        );
    }
}

fn header(names: &[&'static str]) -> Row<'static> {
    Row::new(names.to_vec()).style(Style::new().add_modifier(Modifier::BOLD))
}

fn style(verdict: Verdict) -> Style {
    match verdict {
        Verdict::Fail => Style::new().fg(Color::Red),
        _ => Style::new().fg(Color::Yellow),
    }
}

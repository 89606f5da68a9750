//! Liberties that are a matter of what the vehicle is like.

use std::time::Duration;

use super::ToleranceName as T;
use crate::reference::agv::config::AgvConfig;

pub(super) fn configure(config: &mut AgvConfig, tolerance: T) {
    match tolerance {
        // Whoever is slow to answer is slow in all, else an order would be done before its cancellation is read.
        T::AnswersSlowly => {
            config.answers_after = Duration::from_millis(500);
            slower(config, 6.0);
        }
        T::AnswersVerySlowly => {
            config.answers_after = Duration::from_secs(4);
            slower(config, 40.0);
        }
        T::StatesCoalesced => {
            config.min_state_interval = Duration::from_millis(400);
            slower(config, 6.0);
        }
        T::StatesSeldom => config.state_interval = Duration::from_secs(28),
        T::R4StateEverySecond => config.state_interval = config.state_interval.min(Duration::from_secs(1)),
        T::R4LimitsOfZeroInFactsheet => {
            config.max_nodes = config.max_nodes.max(10_000);
            config.max_instant_actions = config.max_instant_actions.max(1_000);
            config.max_actions = config.max_actions.max(1_000);
        }
        T::StatesOften => config.state_interval = Duration::from_millis(100),
        T::VisualizationOff => config.visualization_interval = None,
        T::VisualizationOften => config.visualization_interval = Some(Duration::from_millis(50)),
        T::DrivesSlowly => slower(config, 4.0),
        T::ActionsAtOnce => {
            // What happens at a station takes the time it takes.
            for action in ["pick", "drop", "finePositioning", "detectObject"] {
                config
                    .action_durations
                    .insert(action.to_owned(), config.action_duration);
            }
            config.action_duration = Duration::ZERO;
        }
        T::R3ReconnectsAtOnce => config.reconnect_delay = Duration::from_millis(50),
        T::ReconnectsLate => config.reconnect_delay = Duration::from_secs(8),
        T::R2KeepAliveTen => config.keep_alive = Duration::from_secs(10),
        T::KeepAliveTwenty => config.keep_alive = Duration::from_secs(20),
        T::LittleFits => {
            config.max_id = 14;
            config.max_actions = 2;
            config.max_instant_actions = 2;
        }
        T::ErrorsStay => config.error_duration = Duration::from_secs(30),
        _ => {}
    }
}

/// Slows it down to this share of its usual pace. Of several reasons the slowest counts: a vehicle a hundred times
/// slower than usual is no good vehicle.
fn slower(config: &mut AgvConfig, times: f64) {
    let more = times / config.slowness;
    if more > 1.0 {
        config.slowness = times;
        config.speed /= more;
        config.rotation_speed /= more;
        config.action_duration = config.action_duration.mul_f64(more);
        // Whichever liberty was taken first.
        for duration in config.action_durations.values_mut() {
            *duration = duration.mul_f64(more);
        }
    }
}

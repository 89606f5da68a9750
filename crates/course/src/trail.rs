//! Where a vehicle was: the places of its way that are apart, in a bounded number.

/// How far a vehicle has to move before its trail grows, in metres.
const STRIDE: f64 = 0.05;

/// What a trail gives up once it has as many places as it may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GivesUp {
    /// Its oldest place: for a vehicle that is looked at while it drives.
    Oldest,
    /// Every second place: for a way that is shown whole, from its beginning to its end.
    Detail,
}

/// Where a vehicle was, the oldest place first, with what is known of each place.
#[derive(Clone, Debug)]
pub struct Trail<T> {
    places: std::collections::VecDeque<(f64, f64, T)>,
    most: usize,
    gives_up: GivesUp,
    stride: f64,
}

impl<T> Trail<T> {
    /// A trail of at most so many places; at least two.
    #[must_use]
    pub fn new(most: usize, gives_up: GivesUp) -> Self {
        Self {
            places: std::collections::VecDeque::new(),
            most: most.max(2),
            gives_up,
            stride: STRIDE,
        }
    }

    /// Goes on to a place, in metres. What is near the last one, and what is no place, is left out.
    pub fn goes_on(&mut self, x: f64, y: f64, known: T) {
        let is_near = self
            .places
            .back()
            .is_some_and(|(last_x, last_y, _)| (x - last_x).hypot(y - last_y) < self.stride);
        if is_near || !x.is_finite() || !y.is_finite() {
            return;
        }
        if self.places.len() >= self.most {
            match self.gives_up {
                GivesUp::Oldest => _ = self.places.pop_front(),
                GivesUp::Detail => {
                    let mut number = 0_usize;
                    self.places.retain(|_| {
                        number += 1;
                        number % 2 == 1
                    });
                    self.stride *= 2.0;
                }
            }
        }
        self.places.push_back((x, y, known));
    }

    /// All places, the oldest first, with what is known of each.
    pub fn known(&self) -> impl DoubleEndedIterator<Item = &(f64, f64, T)> {
        self.places.iter()
    }

    /// All places, the oldest first, in metres.
    #[must_use]
    pub fn places(&self) -> Vec<(f64, f64)> {
        self.places.iter().map(|(x, y, _)| (*x, *y)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trail_is_of_places_apart_and_forgets_the_oldest() {
        let mut trail = Trail::new(400, GivesUp::Oldest);
        for place in [0.0, 0.01, 0.02, 1.0, f64::NAN, f64::INFINITY] {
            trail.goes_on(place, 0.0, ());
        }
        assert_eq!(trail.places(), [(0.0, 0.0), (1.0, 0.0)]);
        for place in 2..=400 {
            trail.goes_on(f64::from(place), 0.0, ());
        }
        assert_eq!((trail.places().len(), trail.places()[0]), (400, (1.0, 0.0)));
    }

    #[test]
    fn a_way_that_is_shown_whole_keeps_both_ends_and_loses_detail() {
        let mut trail = Trail::new(100, GivesUp::Detail);
        for place in 0..10_000 {
            trail.goes_on(f64::from(place) / 10.0, 0.0, place);
        }
        let places = trail.places();
        assert!((25..=100).contains(&places.len()), "{}", places.len());
        assert_eq!(places[0], (0.0, 0.0));
        assert!(places.last().is_some_and(|(x, _)| *x > 950.0), "{places:?}");
        assert!(places.windows(2).all(|pair| pair[0].0 < pair[1].0));
    }
}

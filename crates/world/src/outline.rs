//! The outline of a vehicle as its factsheet draws it.

use tck_base::polygon::{Point, Polygon};
use tck_view::{Envelope2d, FactsheetView};

/// How many outlines are looked at.
const OUTLINES: usize = 32;

/// Outlines larger than this are a mistake, in metres.
const LARGEST: f64 = 100.0;

fn drawn(envelope: &Envelope2d) -> Option<Polygon> {
    let corners = envelope.polygon_points.iter();
    let corners = corners.map(|corner| Some(Point::new(corner.x.float()?, corner.y.float()?)));
    Polygon::new(corners.collect::<Option<Vec<_>>>()?).ok()
}

fn all(sheet: &FactsheetView) -> Vec<Polygon> {
    let geometry = sheet.geometry.there();
    let envelopes = geometry.into_iter().flat_map(|geometry| geometry.envelopes_2d.iter());
    let sane = |outline: &Polygon| {
        outline
            .corners()
            .iter()
            .all(|corner| corner.distance(Point::new(0.0, 0.0)) < LARGEST)
    };
    envelopes.take(OUTLINES).filter_map(drawn).filter(sane).collect()
}

/// The part of the floor that the vehicle takes up for certain: the smallest of its outlines, about its kinematic centre.
/// Length and width alone do not say where the centre is, so none comes of them.
#[must_use]
pub fn outline(sheet: &FactsheetView) -> Option<Polygon> {
    let outlines = all(sheet).into_iter();
    outlines.min_by(|one, other| one.area().total_cmp(&other.area()))
}

/// How far the vehicle reaches from its kinematic centre at most, in metres.
#[must_use]
pub fn radius(sheet: &FactsheetView) -> Option<f64> {
    let centre = Point::new(0.0, 0.0);
    let drawn = all(sheet);
    let corners = drawn.iter().flat_map(Polygon::corners);
    let reach = corners.map(|corner| corner.distance(centre)).reduce(f64::max);
    let size = sheet.physical_parameters.there().and_then(|physical| {
        let (length, width) = (physical.length.float()?, physical.width.float()?);
        (length > 0.0 && width > 0.0).then(|| length.hypot(width))
    });
    reach.or(size).filter(|reach| *reach < LARGEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use tck_view::{MessageView, Names, Topic};

    fn sheet(value: &Value) -> std::sync::Arc<FactsheetView> {
        let view = MessageView::of_value(Topic::Factsheet, value, &Names::default());
        std::sync::Arc::clone(view.factsheet().unwrap())
    }

    #[test]
    fn the_smallest_outline_is_taken_up_and_the_largest_reaches_farthest() {
        let square = |half: f64| {
            json!({ "set": "s", "polygonPoints": [
                { "x": half, "y": half }, { "x": -half, "y": half }, { "x": -half, "y": -half }, { "x": half, "y": -half },
            ] })
        };
        let sheet = sheet(&json!({ "agvGeometry": { "envelopes2d": [square(1.0), square(0.5)] } }));
        assert!((outline(&sheet).unwrap().area() - 1.0).abs() < 1e-9);
        assert!((radius(&sheet).unwrap() - 2.0_f64.sqrt()).abs() < 1e-9);
    }

    #[test]
    fn without_outlines_its_size_says_how_far_it_reaches() {
        let sized = sheet(&json!({ "physicalParameters": { "length": 3.0, "width": 4.0 } }));
        assert!(outline(&sized).is_none());
        assert_eq!(radius(&sized), Some(5.0));
        assert_eq!(radius(&sheet(&json!({}))), None);
    }
}

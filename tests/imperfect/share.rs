//! A share of what is tried one by one.

/// Those of the share that `LIBERTIES` names, such as `2/4`; all of them where it is not set.
pub fn of<'n>(names: impl Iterator<Item = &'n str>) -> impl Iterator<Item = &'n str> {
    let said = std::env::var("LIBERTIES").ok();
    let said = said.as_deref().unwrap_or("1/1");
    let (part, parts) = said.split_once('/').unwrap();
    let [part, parts] = [part, parts].map(|number| number.parse::<usize>().unwrap());
    assert!((1..=parts).contains(&part), "LIBERTIES is {said}");
    names.skip(part - 1).step_by(parts)
}

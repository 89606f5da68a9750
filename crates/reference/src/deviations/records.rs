//! How the records of a topic are written down.

/// The records of a topic: what each is, its name, requirements and sentence, why it is no more than a lapse, and how it
/// is made.
macro_rules! records {
    ($($kind:ident $name:literal [$($id:literal),+] $does:literal $(because $why:literal)? => $make:expr;)+) => {
        pub(super) const RECORDS: &[Record<dyn Deviation>] =
            &[$(Record::<dyn Deviation>::$kind($name, &[$($id),+], $does, || $make)$(.lapse($why))?),+];
    };
}

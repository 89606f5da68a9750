//! Embeds suites, schemas and counterparts anew when a file appears or goes: the compiler alone notices only changed ones.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=suites");
    println!("cargo:rerun-if-changed=schemas");
    println!("cargo:rerun-if-changed=counterparts");
}

//! The program; see the library for everything.

fn main() -> std::process::ExitCode {
    vda5050_tck::cli::main()
}

//! The program; see the library for everything.

/// A run makes and drops many small JSON values, which this allocator does in less time.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> std::process::ExitCode {
    vda5050_tck::cli::main()
}

//! The `vtrace` program; everything is in [`vertex_tracing::cli`].

fn main() -> std::process::ExitCode {
    vertex_tracing::cli::main()
}

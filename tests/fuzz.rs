//! Fuzzing with seeds: importers, request decoders, edit scripts. Each part runs for `REMESH_FUZZ_SECONDS` (default 10) from the seed
//! `REMESH_FUZZ_SEED` (default 1) and prints how many inputs it tried; a failure names the seed of its input.

#[path = "fuzz/edits.rs"]
mod edits;
#[path = "fuzz/importers.rs"]
mod importers;
#[path = "fuzz/random.rs"]
mod random;
#[path = "fuzz/requests.rs"]
mod requests;

use std::time::{Duration, Instant};

/// Calls `one` with seed after seed until the time is up; tells how many there were.
fn for_a_while(what: &str, mut one: impl FnMut(u64)) {
    let number = |name: &str, usual: u64| std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(usual);
    let (first, time) = (number("REMESH_FUZZ_SEED", 1), Duration::from_secs(number("REMESH_FUZZ_SECONDS", 10)));
    let begin = Instant::now();
    let mut count = 0;
    while begin.elapsed() < time {
        one(first.wrapping_mul(1 << 40).wrapping_add(count));
        count += 1;
    }
    println!("fuzz: {count} {what} in {:.0} s, seed {first}", begin.elapsed().as_secs_f64());
}

//! The catalogue of numerical extremes: every case by every technique and route that claims it, against a closed form
//! where there is one. A technique may refuse with an error of its own; it may not draw a wrong image in silence.
//!
//! `docs/EXTREMES.md` lists cases and refusals. It is made from these tests: `VOLRASTER_WRITE_EXTREMES=1` writes it,
//! else it is compared.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    unreachable_pub,
    missing_debug_implementations,
    reason = "a test fails by panicking"
)]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test images")]

mod cameras;
mod catalogue;
mod cuts;
mod document;
mod integrals;
mod limits;
mod meshes;
mod metamorphic;
mod modes;
mod refusals;
mod samples;
mod sizes;
mod splat_limits;
mod splats;
mod support;
mod targets;
mod trained;
mod transfer;

use catalogue::{Family, Results};

/// Every family, in the order of the document.
static FAMILIES: [&Family; 15] = [
    &integrals::FAMILY,
    &transfer::FAMILY,
    &targets::FAMILY,
    &cameras::FAMILY,
    &cuts::FAMILY,
    &samples::FAMILY,
    &sizes::FAMILY,
    &meshes::FAMILY,
    &splats::FAMILY,
    &splat_limits::FAMILY,
    &trained::FAMILY,
    &metamorphic::FAMILY,
    &modes::FAMILY,
    &limits::FAMILY,
    &refusals::FAMILY,
];

/// Runs a family, once in a process, and fails with all that is wrong in it.
#[track_caller]
fn assert_family(family: &'static Family) -> &'static Results {
    let results = family.results();
    println!("{}", results.summary(family));
    let failures: Vec<String> = results.failures().collect();
    assert!(failures.is_empty(), "{} failures in {}:\n{}", failures.len(), family.name, failures.join("\n"));
    results
}

macro_rules! families {
    ($($name:ident),*) => {
        $(
            #[test]
            fn $name() {
                assert_family(&$name::FAMILY);
            }
        )*
    };
}

families!(
    integrals,
    transfer,
    targets,
    cameras,
    cuts,
    samples,
    sizes,
    meshes,
    splats,
    splat_limits,
    trained,
    metamorphic,
    modes,
    refusals
);

#[test]
fn limits() {
    assert_family(&limits::FAMILY);
}

/// The document lists the cases and exactly the refusals that happen, and there are enough of both.
#[test]
#[ignore = "make test-all: it needs every case by every route"]
fn the_document_is_what_happens() {
    let all: Vec<(&Family, &Results)> = FAMILIES.iter().map(|family| (*family, family.results())).collect();
    let cases: usize = all.iter().map(|(family, _)| family.cases.len()).sum();
    let drawn: usize = all.iter().map(|(_, results)| results.drawn()).sum();
    let refused: usize = all.iter().map(|(_, results)| results.refused()).sum();
    let seconds: f64 = all.iter().map(|(_, results)| results.seconds).sum();
    println!(
        "{cases} cases, {drawn} times drawn by a technique and route, {refused} refusals, {seconds:.0} s"
    );
    assert!(cases >= 60, "{cases} cases");
    document::check(&all);
}

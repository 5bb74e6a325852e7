//! The list of all faults.

use super::fault::Fault;
use super::{commands, descriptors, objects, synchronization};

impl Fault {
    /// Returns all faults.
    pub fn all() -> impl Iterator<Item = &'static Self> {
        let lists = [
            &synchronization::FAULTS[..],
            &objects::FAULTS[..],
            &descriptors::FAULTS[..],
            &commands::FAULTS[..],
        ];
        lists.into_iter().flatten()
    }

    /// Returns the fault of a name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::all().find(|fault| fault.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_name_of_its_own_and_a_message_or_a_rule() {
        let faults: Vec<&Fault> = Fault::all().collect();
        assert!(faults.len() >= 30);
        for fault in &faults {
            assert_eq!(
                faults.iter().filter(|other| other.name() == fault.name()).count(),
                1,
                "{}",
                fault.name()
            );
            assert!(fault.ids().is_empty() != fault.rule().is_empty(), "{}", fault.name());
            assert!(fault.name().chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", fault.name());
        }
    }
}

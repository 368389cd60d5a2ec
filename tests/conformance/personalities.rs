//! The simulated board breaks one rule of the document each by its keys: the check of that rule fails.

use gnc_tests::campaign::BREACHES;

use super::failed;
use super::rig::{Breach, Wire, check};

#[test]
fn explore() {
    for (keys, ..) in BREACHES {
        for wire in [Wire::Rs422, Wire::Can] {
            let text = format!("[board]\n{keys}\n");
            match check(&text, wire, None, Breach::default()) {
                Ok(ended) => println!("=== {wire:?} {} -> {:?}", keys.replace('\n', " "), failed(&ended)),
                Err(error) => println!("=== {wire:?} {} -> NO BOARD {error}", keys.replace('\n', " ")),
            }
        }
    }
}

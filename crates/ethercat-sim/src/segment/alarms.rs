//! Who has something to do next, among any number of SubDevices.

/// When each of some positions is due, as a tree of which each node is due when the earlier one of the two below it is: what is
/// asked or set costs as many steps as doublings lead to their number.
#[derive(Debug)]
pub(super) struct Alarms {
    /// Leaves of the tree, a power of two; they stand behind the nodes above them, of which the first isn't used.
    leaves: usize,
    due: Vec<u64>,
}

/// Never due.
pub(super) const NEVER: u64 = u64::MAX;

impl Alarms {
    pub(super) fn new(positions: usize) -> Self {
        let leaves = positions.next_power_of_two();
        Alarms { leaves, due: vec![NEVER; 2 * leaves] }
    }

    /// A position is due at this instant, host ns.
    pub(super) fn set(&mut self, position: usize, due: u64) {
        let mut node = self.leaves + position;
        self.due[node] = due;
        while node > 1 {
            let earlier = self.due[node].min(self.due[node ^ 1]);
            node /= 2;
            if self.due[node] == earlier {
                return;
            }
            self.due[node] = earlier;
        }
    }

    /// When one is due next.
    pub(super) fn earliest(&self) -> Option<u64> {
        Some(self.due[1]).filter(|&due| due != NEVER)
    }

    /// The first position from `from` on that is due by `at`.
    pub(super) fn first_due(&self, from: usize, at: u64) -> Option<usize> {
        if from >= self.leaves {
            return None;
        }
        let mut node = self.leaves + from;
        while self.due[node] > at {
            // Up from what lies on the right, then to the right.
            while node % 2 == 1 {
                node /= 2;
            }
            if node == 0 {
                return None;
            }
            node += 1;
        }
        while node < self.leaves {
            node *= 2;
            if self.due[node] > at {
                node += 1;
            }
        }
        Some(node - self.leaves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_answers_as_a_list_would() {
        for positions in [1, 2, 3, 7, 8, 100] {
            let mut alarms = Alarms::new(positions);
            let mut list = vec![NEVER; positions];
            assert_eq!((alarms.earliest(), alarms.first_due(0, 1000)), (None, None));
            let mut random = 1_u64;
            for _ in 0..2000 {
                random =
                    random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let (position, due) = ((random >> 33) as usize % positions, (random >> 20) % 50);
                let due = if due == 0 { NEVER } else { due };
                list[position] = due;
                alarms.set(position, due);
                assert_eq!(alarms.earliest(), list.iter().copied().min().filter(|&due| due != NEVER));
                let (from, at) = ((random >> 45) as usize % (positions + 1), (random >> 12) % 60);
                let expected = (from..positions).find(|&position| list[position] <= at);
                assert_eq!(alarms.first_due(from, at), expected, "{list:?} from {from} at {at}");
            }
        }
    }
}

//! Taking bisections back: halves that are drawn as one picture need not be drawn apart.

use super::{Mesh, NONE, UNITED, side};

impl Mesh {
    /// Takes bisections back, the last first, wherever all halves around an edge are leaves and `join` lets them go. It is
    /// given a face, and what is `known` of it and of its halves, and says what is known of it as a leaf, or `None`. The
    /// mesh stays conforming: a vertex goes once nothing around it needs it.
    pub fn unite<T: Copy>(&mut self, known: &mut [T], join: impl Fn(&Self, u32, T, [T; 2]) -> Option<T>) {
        let mut parent = vec![NONE; self.faces.len()];
        for (index, face) in self.faces.iter().enumerate().filter(|(_, face)| face.is_bisected()) {
            for half in face.children {
                parent[half as usize] = index as u32;
            }
        }
        // Halves come in pairs, and those of one edge together.
        let mut end = self.faces.len();
        while end > self.roots.len() {
            let middle = self.middle(end - 1);
            let pairs = (self.roots.len()..end).step_by(2).rev();
            let pairs = pairs.take_while(|&left| self.middle(left) == middle).count();
            let start = end - 2 * pairs;
            let wholes: Vec<u32> = (start..end).step_by(2).map(|left| parent[left]).collect();
            if (start..end).all(|half| self.faces[half].is_leaf()) {
                let joined: Option<Vec<T>> = wholes
                    .iter()
                    .map(|&whole| {
                        let halves = self.faces[whole as usize].children.map(|half| known[half as usize]);
                        join(self, whole, known[whole as usize], halves)
                    })
                    .collect();
                if let Some(joined) = joined {
                    self.take_back(&wholes);
                    wholes.iter().zip(joined).for_each(|(&whole, joined)| known[whole as usize] = joined);
                }
            }
            end = start;
        }
    }

    /// The point between the ends of the bisected edge that made half `half`.
    fn middle(&self, half: usize) -> u32 {
        self.vertices[self.faces[half].corners[2] as usize].point
    }

    /// Makes leaves of all faces `wholes` around a bisected edge again.
    fn take_back(&mut self, wholes: &[u32]) {
        for &whole in wholes {
            let face = self.faces[whole as usize];
            let [left, right] = face.children;
            let split = usize::from(face.longest);
            self.replace(side(left, 0), side(whole, (split + 2) % 3));
            self.replace(side(right, 0), side(whole, (split + 1) % 3));
            self.faces[whole as usize].children = [NONE; 2];
            for half in [left, right] {
                self.faces[half as usize].children = [UNITED; 2];
            }
        }
        let sides: Vec<_> = wholes.iter().map(|&whole| self.longest(whole)).collect();
        self.link_cycle(sides.into_iter());
    }
}

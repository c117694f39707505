//! A few of many, spread over them.

/// At most `most` of `all`, in their order and evenly chosen; the first one is among them.
pub fn evenly<T>(all: &[T], most: usize) -> impl ExactSizeIterator<Item = &T> {
    let num = all.len().min(most);
    (0..num).map(move |i| &all[i * all.len() / num])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn some_of_many_are_as_far_apart_as_can_be() {
        let all: Vec<u32> = (0..10).collect();
        let chosen = |most| evenly(&all, most).copied().collect::<Vec<_>>();
        assert_eq!(chosen(3), [0, 3, 6]);
        assert_eq!(chosen(5), [0, 2, 4, 6, 8]);
        assert_eq!(chosen(20), all);
        assert!(chosen(0).is_empty() && evenly::<u32>(&[], 3).next().is_none());
    }
}

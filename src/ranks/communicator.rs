//! The ways in which ranks exchange bytes, and agree.

use std::cell::Cell;
use std::sync::mpsc::{Receiver, Sender, channel};

use crate::error::{Error, Result};
use crate::num;

/// A way for ranks to exchange bytes.
pub trait Communicator {
    /// Returns the number of this rank, from 0.
    fn rank(&self) -> u32;

    /// Returns the number of ranks.
    fn size(&self) -> u32;

    /// Sends bytes to each of some other ranks, all of which send to this one in a call of theirs, and returns what they send, in the order of
    /// `messages`. No message waits for another of the same call.
    ///
    /// # Errors
    ///
    /// Those of the transport, such as a rank that has ended.
    fn exchange(&self, messages: &[(u32, Vec<u8>)]) -> Result<Vec<Vec<u8>>>;
}

/// A communicator that counts the bytes that it sends.
#[derive(Debug)]
pub struct Counted<C> {
    inner: C,
    sent: Cell<u64>,
}

impl<C: Communicator> Counted<C> {
    /// Takes a communicator that has sent nothing yet.
    pub fn new(inner: C) -> Self {
        Self { inner, sent: Cell::new(0) }
    }

    /// Returns the bytes sent so far.
    pub fn sent(&self) -> u64 {
        self.sent.get()
    }
}

impl<C: Communicator> Communicator for Counted<C> {
    fn rank(&self) -> u32 {
        self.inner.rank()
    }

    fn size(&self) -> u32 {
        self.inner.size()
    }

    fn exchange(&self, messages: &[(u32, Vec<u8>)]) -> Result<Vec<Vec<u8>>> {
        let bytes: u64 = messages.iter().map(|(_, bytes)| num::wide(bytes.len())).sum();
        self.sent.set(self.sent.get() + bytes);
        self.inner.exchange(messages)
    }
}

/// Collects bytes of all other ranks on rank 0, from rank 1 on; the others get `None`.
///
/// # Errors
///
/// Those of the communicator.
pub fn gather(ranks: &dyn Communicator, bytes: impl FnOnce() -> Vec<u8>) -> Result<Option<Vec<Vec<u8>>>> {
    if ranks.rank() > 0 {
        return ranks.exchange(&[(0, bytes())]).map(|_| None);
    }
    let from: Vec<_> = (1..ranks.size()).map(|rank| (rank, Vec::new())).collect();
    ranks.exchange(&from).map(Some)
}

/// Makes the failure of one rank that of all: returns what this rank has made where no rank has failed, else the error of the first that has.
///
/// # Errors
///
/// This rank's own error, or [`Error::Rank`] with that of another; those of the communicator.
pub fn agree<T>(ranks: &dyn Communicator, made: Result<T>) -> Result<T> {
    // The failure of the lowest rank that this one has heard of: the rank, its exit code and text.
    let mut first = match &made {
        Ok(_) => Vec::new(),
        Err(error) => {
            [&ranks.rank().to_be_bytes()[..], &[error.exit_code()], error.to_string().as_bytes()].concat()
        }
    };
    // With strides of 1, 3, 9, ... each hears of three times as many ranks in every round.
    let mut stride = 1;
    while stride < ranks.size() {
        let messages: Vec<_> = neighbours(ranks, stride).map(|rank| (rank, first.clone())).collect();
        let heard = ranks.exchange(&messages)?.into_iter().chain([first]);
        first = heard.filter(|failure| !failure.is_empty()).min().unwrap_or_default();
        stride = stride.saturating_mul(3);
    }
    let (Some((rank, rest)), true) = (first.split_first_chunk::<4>(), made.is_ok()) else { return made };
    let (code, why) = rest.split_first().map_or((1, &[][..]), |(code, why)| (*code, why));
    Err(Error::Rank { rank: u32::from_be_bytes(*rank), code, why: String::from_utf8_lossy(why).into_owned() })
}

/// Checks that bytes are the same on all ranks.
///
/// # Errors
///
/// [`Error::Invalid`] on ranks beside which they differ, and [`Error::Rank`] on others, with what the bytes are; those of the communicator.
pub(super) fn alike(ranks: &dyn Communicator, what: &str, bytes: &[u8]) -> Result<()> {
    let messages: Vec<_> = neighbours(ranks, 1).map(|rank| (rank, bytes.to_vec())).collect();
    let received = ranks.exchange(&messages)?;
    let differs = messages.iter().zip(received).find(|(_, other)| other != bytes);
    let why = |((other, _), _): (&(u32, _), _)| {
        Err(Error::invalid(what, format!("differs between rank {} and rank {other}", ranks.rank())))
    };
    agree(ranks, differs.map_or(Ok(()), why))
}

/// Returns the ranks that lie `stride` before and behind this one in the ring of all; each once, and not this one.
fn neighbours(ranks: &dyn Communicator, stride: u32) -> impl Iterator<Item = u32> {
    let (rank, size) = (ranks.rank(), ranks.size());
    let stride = stride % size;
    let [before, behind] = [(rank + size - stride) % size, (rank + stride) % size];
    [before].into_iter().chain((behind != before).then_some(behind)).filter(move |&other| other != rank)
}

/// Ranks that are threads of this process.
#[derive(Debug)]
pub struct Threads {
    rank: u32,
    to: Vec<Sender<Vec<u8>>>,
    from: Vec<Receiver<Vec<u8>>>,
}

impl Threads {
    /// Makes the ends of `size` ranks.
    #[must_use]
    pub fn new(size: u32) -> Vec<Self> {
        let ranks = 0..num::index(size);
        let mut to: Vec<Vec<_>> = ranks.clone().map(|_| Vec::new()).collect();
        let mut from: Vec<Vec<_>> = ranks.clone().map(|_| Vec::new()).collect();
        for sender in ranks.clone() {
            for receiver in &mut from {
                let (send, receive) = channel();
                to[sender].push(send);
                receiver.push(receive);
            }
        }
        to.into_iter().zip(from).zip(0..).map(|((to, from), rank)| Self { rank, to, from }).collect()
    }

    /// Runs work as so many ranks, each on a thread, and returns what each has made, by rank. A panic of one goes on here.
    pub fn run<T: Send>(size: u32, work: impl Fn(Self) -> T + Sync) -> Vec<T> {
        let work = &work;
        std::thread::scope(|scope| {
            let running: Vec<_> =
                Self::new(size).into_iter().map(|end| scope.spawn(move || work(end))).collect();
            let made = |thread: std::thread::ScopedJoinHandle<'_, T>| {
                thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            };
            running.into_iter().map(made).collect()
        })
    }
}

impl Communicator for Threads {
    fn rank(&self) -> u32 {
        self.rank
    }

    fn size(&self) -> u32 {
        num::count(self.to.len())
    }

    fn exchange(&self, messages: &[(u32, Vec<u8>)]) -> Result<Vec<Vec<u8>>> {
        for (rank, bytes) in messages {
            let to = self.to.get(num::index(*rank));
            to.and_then(|to| to.send(bytes.clone()).ok()).ok_or_else(|| gone(*rank))?;
        }
        let received = |(rank, _): &(u32, Vec<u8>)| {
            self.from.get(num::index(*rank)).and_then(|from| from.recv().ok()).ok_or_else(|| gone(*rank))
        };
        messages.iter().map(received).collect()
    }
}

fn gone(rank: u32) -> Error {
    Error::Rank { rank, code: 1, why: "has ended".to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// So many ranks, of which these fail, agree.
    fn heard(size: u32, failing: &[u32]) -> Vec<Result<u32>> {
        Threads::run(size, |end| {
            let rank = end.rank();
            let fails = failing.contains(&rank);
            agree(&end, if fails { Err(Error::invalid("part", format!("of {rank}"))) } else { Ok(rank) })
        })
    }

    #[test]
    fn a_failure_of_one_rank_is_one_of_all() {
        for size in 1..=30 {
            let made: Result<Vec<u32>> = heard(size, &[]).into_iter().collect();
            assert!(made.unwrap().into_iter().eq(0..size));
            for failing in [vec![0], vec![size - 1], vec![size / 2, size - 1]] {
                for (rank, result) in (0..).zip(heard(size, &failing)) {
                    let error = result.unwrap_err();
                    let own = failing.contains(&rank);
                    let want = if own {
                        format!("invalid part: of {rank}")
                    } else {
                        format!("rank {}: invalid part: of {}", failing[0], failing[0])
                    };
                    assert_eq!((error.to_string(), error.exit_code()), (want, 2), "{size} {failing:?}");
                }
            }
        }
    }

    #[test]
    fn bytes_are_alike_on_all_ranks_or_an_error_on_all() {
        for size in 1..=12 {
            assert!(Threads::run(size, |end| alike(&end, "size", &[7, 8])).iter().all(Result::is_ok));
            for odd in 0..size {
                let results =
                    Threads::run(size, |end| alike(&end, "size", &[7, u8::from(end.rank() == odd)]));
                let differs = |result: &Result<()>| {
                    let why = result.as_ref().unwrap_err().to_string();
                    why.contains("size") && why.contains(&format!("rank {odd}"))
                };
                assert!(size == 1 || results.iter().all(differs), "{size} {odd}: {results:?}");
            }
        }
    }

    #[test]
    fn a_rank_that_has_ended_is_an_error() {
        let [first, second] = <[Threads; 2]>::try_from(Threads::new(2)).unwrap();
        drop(second);
        let error = first.exchange(&[(1, vec![1, 2])]).unwrap_err();
        assert_eq!(error.to_string(), "rank 1: has ended");
    }
}

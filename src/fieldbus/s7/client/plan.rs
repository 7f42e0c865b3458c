//! From images to jobs: what is written and read in one cycle, as few jobs as the agreed length allows.

use std::ops::Range;

use crate::fieldbus::s7::item::{self, Item, Object};
use crate::fieldbus::s7::pdu;

/// The most items of a job that every CPU takes.
const ITEMS: usize = 20;

/// Images are cut at multiples of this, so that no value that lies at a multiple of its width is in two jobs.
const GRAIN: usize = 8;

/// Bytes before the items of a job, and of an answer: header, function, number of items.
const JOB: usize = pdu::JOB_HEADER + 2;
const ANSWER: usize = pdu::ANSWER_HEADER + 2;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Way {
    Write,
    Read,
}

/// A piece of a station's frame, and where it lies in the CPU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) station: usize,
    pub(super) frame: Range<usize>,
    pub(super) item: Item,
}

/// One job.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Job {
    pub(super) way: Way,
    pub(super) pieces: Vec<Piece>,
}

/// A frame and where it lies: station, object, first byte there, length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Image {
    pub(super) station: usize,
    pub(super) object: Object,
    pub(super) byte: usize,
    pub(super) length: usize,
}

/// The jobs that carry `images`, none of which, nor its answer, is longer than `limit`.
pub(super) fn jobs(way: Way, images: &[Image], limit: usize) -> Vec<Job> {
    let mut jobs: Vec<Job> = Vec::new();
    // Lengths of the last job and of its answer.
    let mut lengths = [0, 0];
    for image in images {
        let mut begin = 0;
        while begin < image.length {
            let rest = image.length - begin;
            let open = jobs.last().filter(|job| job.pieces.len() < ITEMS);
            let room = open.map_or(0, |_| room(way, lengths, limit));
            // A new job is begun rather than that the rest of an old one is filled with a piece.
            let (take, is_new) = if rest <= room {
                (rest, false)
            } else {
                let whole = self::room(way, [JOB, ANSWER], limit);
                let take = if rest <= whole {
                    rest
                } else {
                    whole / GRAIN * GRAIN
                };
                (take, true)
            };
            if is_new {
                jobs.push(Job {
                    way,
                    pieces: Vec::new(),
                });
                lengths = [JOB, ANSWER];
            }
            let first = image.byte + begin;
            let job = jobs.last_mut().expect("one was there, or was made");
            job.pieces.push(Piece {
                station: image.station,
                frame: begin..begin + take,
                item: Item::bytes(image.object, first..first + take),
            });
            let data = item::DATA_HEADER + take.next_multiple_of(2);
            lengths = match way {
                Way::Write => [lengths[0] + item::ADDRESS + data, lengths[1] + 1],
                Way::Read => [lengths[0] + item::ADDRESS, lengths[1] + data],
            };
            begin += take;
        }
    }
    jobs
}

/// How many bytes one more item of a job may have.
fn room(way: Way, [job, answer]: [usize; 2], limit: usize) -> usize {
    let room = match way {
        Way::Write => limit.saturating_sub(job + item::ADDRESS + item::DATA_HEADER),
        Way::Read if job + item::ADDRESS > limit => 0,
        Way::Read => limit.saturating_sub(answer + item::DATA_HEADER),
    };
    // An odd one is filled up.
    room / 2 * 2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(station: usize, length: usize) -> Image {
        Image {
            station,
            object: Object::Block(10),
            byte: 100,
            length,
        }
    }

    fn lengths(job: &Job) -> [usize; 2] {
        let items = job.pieces.len() * item::ADDRESS;
        let data: usize = job
            .pieces
            .iter()
            .map(|piece| item::DATA_HEADER + piece.frame.len().next_multiple_of(2))
            .sum();
        match job.way {
            Way::Write => [JOB + items + data, ANSWER + job.pieces.len()],
            Way::Read => [JOB + items, ANSWER + data],
        }
    }

    #[test]
    fn every_byte_is_carried_once_and_no_job_is_too_long() {
        for way in [Way::Write, Way::Read] {
            for limit in [64, 112, 240, 480, 960] {
                for sizes in [&[1][..], &[360], &[134, 3, 5, 1], &[1; 50], &[4096, 1]] {
                    let images = sizes.iter().enumerate();
                    let images: Vec<Image> = images
                        .map(|(station, size)| image(station, *size))
                        .collect();
                    let jobs = jobs(way, &images, limit);
                    let mut carried = vec![0; sizes.len()];
                    for job in &jobs {
                        assert!(!job.pieces.is_empty() && job.pieces.len() <= ITEMS);
                        let long = lengths(job).into_iter().any(|length| length > limit);
                        assert!(!long, "{way:?} {limit} {job:?}");
                        for piece in &job.pieces {
                            let carried = &mut carried[piece.station];
                            assert_eq!(piece.frame.start, *carried);
                            assert_eq!(piece.item.range().start, 100 + *carried);
                            assert_eq!(piece.item.range().len(), piece.frame.len());
                            *carried = piece.frame.end;
                        }
                    }
                    assert_eq!(carried, sizes);
                }
            }
        }
    }

    #[test]
    fn what_fits_into_one_job_is_one_job_and_long_images_are_cut_between_values() {
        assert_eq!(jobs(Way::Write, &[image(0, 360)], 480).len(), 1);
        assert_eq!(
            jobs(Way::Read, &[image(0, 134), image(1, 130)], 480).len(),
            1
        );
        assert_eq!(jobs(Way::Read, &[image(0, 462)], 480).len(), 1);
        let cut = jobs(Way::Read, &[image(0, 463)], 480);
        assert_eq!(cut[0].pieces[0].frame, 0..456);
        assert_eq!(cut[1].pieces[0].frame, 456..463);
        assert!(jobs(Way::Read, &[image(0, 0)], 480).is_empty());
    }
}

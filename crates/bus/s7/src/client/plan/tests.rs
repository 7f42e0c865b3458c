use std::collections::BTreeSet;

use proptest::prelude::*;

use super::*;

/// Adjacent signals of one size in a station's frame, from `first` on in data block 10.
fn run(station: usize, first: usize, bytes: usize) -> Vec<Field> {
    let field = |byte: usize| Field {
        station,
        frame: byte * 8,
        object: Object::Block(10),
        first: (first + byte) * 8,
        bits: 8,
    };
    (0..bytes).map(field).collect()
}

fn bit(frame: usize, first: usize) -> Field {
    Field {
        station: 0,
        frame,
        object: Object::Flags,
        first,
        bits: 1,
    }
}

fn items(jobs: &[Job]) -> Vec<(Object, Range<usize>, Option<u8>)> {
    let pieces = jobs.iter().flat_map(|job| &job.pieces);
    let one = |piece: &Piece| (piece.item.object, piece.item.range(), piece.item.bit());
    pieces.map(one).collect()
}

#[test]
fn a_gap_is_read_over_and_never_written_over() {
    let fields = [run(0, 0, 2), run(0, 8, 2)].concat();
    let block = Object::Block(10);
    assert_eq!(
        items(&jobs(JobDirection::Write, &fields, 240)),
        [(block, 0..2, None), (block, 8..10, None)]
    );
    let near = [run(0, 0, 2), run(0, 6, 2)].concat();
    assert_eq!(
        items(&jobs(JobDirection::Read, &near, 240)),
        [(block, 0..8, None)]
    );
    // A long gap costs more than a separate item.
    let far = [run(0, 0, 2), run(0, 60, 2)].concat();
    assert_eq!(
        items(&jobs(JobDirection::Read, &far, 240)),
        [(block, 0..2, None), (block, 60..62, None)]
    );
}

#[test]
fn a_bool_is_written_as_a_bit_unless_all_of_its_byte_is_written() {
    let some = [bit(3, 40), bit(9, 47)];
    assert_eq!(
        items(&jobs(JobDirection::Write, &some, 240)),
        [
            (Object::Flags, 5..6, Some(0)),
            (Object::Flags, 5..6, Some(7))
        ]
    );
    assert_eq!(
        items(&jobs(JobDirection::Read, &some, 240)),
        [(Object::Flags, 5..6, None)]
    );
    let all: Vec<Field> = (0..8).map(|index| bit(index, 47 - index)).collect();
    let jobs = jobs(JobDirection::Write, &all, 240);
    assert_eq!(items(&jobs), [(Object::Flags, 5..6, None)]);
    let mut data = [0];
    jobs[0].pieces[0].gather(&[0b0000_0011], &mut data);
    assert_eq!(data, [0b1100_0000]);
}

#[test]
fn what_fits_into_one_job_is_one_job_and_long_runs_are_cut_between_values() {
    assert_eq!(jobs(JobDirection::Write, &run(0, 0, 360), 480).len(), 1);
    let two = [run(0, 0, 134), run(1, 134, 130)].concat();
    assert_eq!(jobs(JobDirection::Read, &two, 480).len(), 1);
    assert_eq!(jobs(JobDirection::Read, &run(0, 0, 462), 480).len(), 1);
    // Values of 8 bytes from an odd byte on: 462 bytes would fit.
    let numbers = (0..58).map(|index| Field {
        bits: 64,
        frame: index * 64 + 8,
        first: index * 64 + 8,
        ..run(0, 0, 1)[0]
    });
    let fields: Vec<Field> = run(0, 0, 1).into_iter().chain(numbers).collect();
    let jobs = jobs(JobDirection::Read, &fields, 480);
    assert_eq!(
        items(&jobs),
        [
            (Object::Block(10), 0..457, None),
            (Object::Block(10), 457..465, None)
        ]
    );
    assert!(super::jobs(JobDirection::Read, &[], 480).is_empty());
}

#[test]
fn sparse_values_are_read_in_fewer_jobs_where_gaps_are_read_over() {
    // 40 words, each 10 bytes after the previous one: 19 items fill a job of 240 bytes.
    let fields: Vec<Field> = (0..40).flat_map(|index| run(0, index * 10, 2)).collect();
    assert_eq!(jobs(JobDirection::Read, &fields, 240).len(), 2);
    assert_eq!(jobs(JobDirection::Read, &fields, 480).len(), 1);
}

/// Signals that do not overlap in the frames or in the CPU.
fn signals() -> impl Strategy<Value = Vec<Field>> {
    let one = (0..3_usize, 0..3_u16, 0..400_usize, 0..8_usize, 0..5_usize);
    prop::collection::vec(one, 0..150).prop_map(|all| {
        let mut taken = BTreeSet::new();
        let mut frames = [0; 3];
        let mut fields = Vec::new();
        for (station, object, byte, bit, width) in all {
            let object = match object {
                0 => Object::Inputs,
                1 => Object::Flags,
                number => Object::Block(number),
            };
            let (first, bits) = match width {
                0 => (byte * 8 + bit, 1),
                width => (byte * 8, 4 << width),
            };
            let mut own = (first..first + bits).map(|bit| (object, bit));
            if own.clone().any(|bit| taken.contains(&bit)) {
                continue;
            }
            own.by_ref().for_each(|bit| {
                taken.insert(bit);
            });
            let frame: &mut usize = &mut frames[station];
            // Some BOOLs leave the rest of their byte unused.
            if bits > 1 {
                *frame = frame.next_multiple_of(8);
            }
            fields.push(Field {
                station,
                frame: *frame,
                object,
                first,
                bits,
            });
            *frame += bits;
        }
        fields
    })
}

fn lengths(job: &Job) -> [usize; 2] {
    let items = job.pieces.len() * item::ADDRESS;
    let data = |piece: &Piece| item::DATA_HEADER + piece.item.range().len().next_multiple_of(2);
    let data: usize = job.pieces.iter().map(data).sum();
    match job.way {
        JobDirection::Write => [JOB + items + data, ANSWER + job.pieces.len()],
        JobDirection::Read => [JOB + items, ANSWER + data],
    }
}

/// A CPU and the frames of three stations, in which every bit encodes its position.
const BYTES: usize = 512;
const OBJECTS: [Object; 3] = [Object::Inputs, Object::Flags, Object::Block(2)];

fn memory(seed: u8) -> Vec<u8> {
    let bytes = (0..=u8::MAX).cycle();
    let told = bytes.map(|index| index.wrapping_mul(167).wrapping_add(seed));
    told.take(BYTES * 3).collect()
}

fn place(object: Object) -> usize {
    let found = OBJECTS.iter().position(|other| *other == object);
    found.expect("one of them") * BYTES
}

fn bit_at(bytes: &[u8], bit: usize) -> bool {
    bytes[bit / 8] >> (bit % 8) & 1 == 1
}

proptest! {
    #[test]
    fn every_signal_is_carried_and_no_other_bit_is_written(
        fields in signals(),
        limit in prop::sample::select(vec![64_usize, 112, 240, 480, 960]),
    ) {
        let frames: Vec<Vec<u8>> = (1..4).map(memory).collect();
        for way in [JobDirection::Write, JobDirection::Read] {
            let jobs = jobs(way, &fields, limit);
            for job in &jobs {
                prop_assert!(!job.pieces.is_empty() && job.pieces.len() <= ITEMS);
                prop_assert!(lengths(job).iter().all(|length| *length <= limit));
            }
            let pieces = || jobs.iter().flat_map(|job| &job.pieces);
            let mut cpu = memory(99);
            let before = cpu.clone();
            let mut read = vec![vec![0; BYTES * 3]; 3];
            for piece in pieces() {
                let range = piece.item.range();
                let begin = place(piece.item.object);
                let range = begin + range.start..begin + range.end;
                match (way, piece.item.bit()) {
                    (JobDirection::Write, None) => {
                        // A byte that is not filled would remain zero.
                        let mut data = vec![0; range.len()];
                        piece.gather(&frames[piece.station], &mut data);
                        cpu[range].copy_from_slice(&data);
                    }
                    (JobDirection::Write, Some(bit)) => {
                        let mut data = [0];
                        piece.gather(&frames[piece.station], &mut data);
                        prop_assert!(data[0] <= 1);
                        let byte = &mut cpu[range.start];
                        *byte = *byte & !(1 << bit) | data[0] << bit;
                    }
                    (JobDirection::Read, bit) => {
                        prop_assert_eq!(bit, None);
                        piece.scatter(&before[range], &mut read[piece.station]);
                    }
                }
            }
            let mut named = vec![0_u8; BYTES * 3];
            for field in &fields {
                for index in 0..field.bits {
                    let there = place(field.object) * 8 + field.first + index;
                    let here = field.frame + index;
                    named[there / 8] |= 1 << (there % 8);
                    match way {
                        JobDirection::Write => prop_assert_eq!(
                            bit_at(&cpu, there),
                            bit_at(&frames[field.station], here)
                        ),
                        JobDirection::Read => prop_assert_eq!(
                            bit_at(&before, there),
                            bit_at(&read[field.station], here)
                        ),
                    }
                }
            }
            for (byte, named) in named.iter().enumerate() {
                let changed = (cpu[byte] ^ before[byte]) & !named;
                prop_assert_eq!(changed, 0, "bits of byte {} that nobody named", byte);
            }
        }
    }

    #[test]
    fn values_may_be_read_that_lie_over_one_another(
        fields in prop::collection::vec((0..60_usize, 0..8_usize, 0..5_usize), 1..40),
    ) {
        let mut frame = 0;
        let fields: Vec<Field> = fields.into_iter().map(|(byte, bit, width)| {
            let (first, bits) = if width == 0 { (byte * 8 + bit, 1) } else { (byte * 8, 4 << width) };
            let field = Field { station: 0, frame, object: Object::Flags, first, bits };
            frame += 64;
            field
        }).collect();
        let cpu = memory(5);
        let mut read = vec![0; fields.len() * 8];
        for piece in jobs(JobDirection::Read, &fields, 240).iter().flat_map(|job| &job.pieces) {
            piece.scatter(&cpu[piece.item.range()], &mut read);
        }
        for field in &fields {
            for index in 0..field.bits {
                prop_assert_eq!(bit_at(&cpu, field.first + index), bit_at(&read, field.frame + index));
            }
        }
    }
}

//! The client's half of the codec: what is asked for, and what an answer to it may be.

use std::fmt;

use crate::fieldbus::modbus::function::{
    EXCEPTION_BIT, READ_BITS, READ_REGISTERS, READ_WRITE_REGISTERS, WRITE_BITS, WRITE_REGISTERS,
};
use crate::fieldbus::modbus::table::{Span, Table, put_bits, take_bits};
use crate::fieldbus::modbus::{Exception, Function, Place};

/// Bytes of an image that lie in a table, all in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// The table.
    pub table: Table,
    /// The offset of the first element.
    pub first: usize,
    /// The first byte of the image.
    pub byte: usize,
    /// How many bytes. Of a last register half of which is none of these only the first half counts.
    pub bytes: usize,
}

impl Block {
    /// The elements that it takes; one where it has no bytes and is only looked at.
    pub const fn span(self) -> Span {
        let count = match self.table.elements(self.bytes) {
            0 => 1,
            count => count,
        };
        let first = self.first;
        Span { first, count }
    }

    /// Cut such that none has more than so many elements.
    fn pieces(self, most: usize) -> impl Iterator<Item = Self> {
        let most_bytes = most * self.table.width() / 8;
        (0..self.bytes).step_by(most_bytes).map(move |begin| Self {
            first: self.first + begin * 8 / self.table.width(),
            byte: self.byte + begin,
            bytes: most_bytes.min(self.bytes - begin),
            ..self
        })
    }
}

/// Both ways to write its elements, as a message has them.
impl fmt::Display for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Span { first, count } = self.span();
        let table = self.table;
        let place = |offset| Place { table, offset };
        match count {
            0 | 1 => place(first).fmt(f),
            _ => write!(f, "{} to {}", place(first), first + count - 1),
        }
    }
}

/// One request of the client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Query {
    /// Reads what belongs there.
    Read(Block),
    /// Writes it.
    Write(Block),
    /// Writes, then reads; both holding registers.
    Both {
        /// What is written.
        write: Block,
        /// What is read.
        read: Block,
    },
}

/// Why an answer is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The server refused.
    Refused(Exception),
    /// The answer is not as the standard wants it.
    Malformed(String),
}

/// The requests that bring a station's image across: what is written first, and as few as the limits allow.
pub fn queries(reads: &[Block], writes: &[Block], combine: bool) -> Vec<Query> {
    let holding = |block: &&Block| block.table == Table::HoldingRegisters;
    let combine = combine && reads.iter().any(|block| holding(&block));
    let combine = combine && writes.iter().any(|block| holding(&block));
    let most_written = |table: Table| match (table.is_bits(), combine) {
        (true, _) => WRITE_BITS,
        (false, false) => WRITE_REGISTERS,
        (false, true) => READ_WRITE_REGISTERS,
    };
    let most_read = |table: Table| {
        if table.is_bits() {
            READ_BITS
        } else {
            READ_REGISTERS
        }
    };
    let writes = writes.iter();
    let writes: Vec<Block> = writes
        .flat_map(|block| block.pieces(most_written(block.table)))
        .collect();
    let mut reads: Vec<Block> = reads
        .iter()
        .flat_map(|block| block.pieces(most_read(block.table)))
        .collect();
    let mut queries = Vec::with_capacity(writes.len() + reads.len());
    for write in writes {
        let beside = combine && holding(&&write);
        let read = reads.iter().position(|read| beside && holding(&read));
        queries.push(match read {
            Some(read) => Query::Both {
                write,
                read: reads.remove(read),
            },
            None => Query::Write(write),
        });
    }
    queries.extend(reads.into_iter().map(Query::Read));
    queries
}

impl Query {
    /// What it asks the server for.
    pub const fn function(self) -> Function {
        match self {
            Self::Both { .. } => Function::ReadWriteRegisters,
            Self::Read(block) => match block.table {
                Table::Coils => Function::ReadCoils,
                Table::DiscreteInputs => Function::ReadDiscreteInputs,
                Table::InputRegisters => Function::ReadInputRegisters,
                Table::HoldingRegisters => Function::ReadHoldingRegisters,
            },
            Self::Write(block) => {
                if block.table.is_bits() {
                    Function::WriteCoils
                } else {
                    Function::WriteRegisters
                }
            }
        }
    }

    /// What it reads.
    pub const fn read(self) -> Option<Block> {
        match self {
            Self::Read(read) | Self::Both { read, .. } => Some(read),
            Self::Write(_) => None,
        }
    }

    /// Appends its PDU; what it writes is taken from `sends`.
    ///
    /// # Panics
    ///
    /// When that is too short, or the query is larger than the limits allow.
    pub fn append(self, sends: &[u8], pdu: &mut Vec<u8>) {
        pdu.push(self.function().code());
        match self {
            Self::Read(read) => append_span(read.span(), pdu),
            Self::Write(write) => append_values(write, sends, pdu),
            Self::Both { write, read } => {
                append_span(read.span(), pdu);
                append_values(write, sends, pdu);
            }
        }
    }

    /// Takes over what the answer `pdu` brings, into `receives`.
    ///
    /// # Errors
    ///
    /// The answer is a refusal, or malformed; then nothing was taken over.
    pub fn take(self, pdu: &[u8], receives: &mut [u8]) -> Result<(), Fault> {
        let data = expect(self.function(), pdu)?;
        let Some(read) = self.read() else {
            return self.check_echo(data);
        };
        let span = read.span();
        let expected = (span.count * read.table.width()).div_ceil(8);
        match data.split_first() {
            Some((counted, values))
                if usize::from(*counted) == expected && values.len() == expected =>
            {
                let target = &mut receives[read.byte..][..read.bytes];
                if read.table.is_bits() {
                    put_bits(values, read.bytes * 8, target, 0);
                } else {
                    target.copy_from_slice(&values[..read.bytes]);
                }
                Ok(())
            }
            _ => Err(Fault::Malformed(format!(
                "its answer has {} bytes behind the function code, where a count and {expected} bytes belong",
                data.len()
            ))),
        }
    }

    fn check_echo(self, data: &[u8]) -> Result<(), Fault> {
        let Self::Write(write) = self else {
            return Ok(());
        };
        let mut echo = Vec::with_capacity(4);
        append_span(write.span(), &mut echo);
        if data == echo {
            return Ok(());
        }
        Err(Fault::Malformed(format!(
            "its answer to a write is {data:02X?}, where the request's {echo:02X?} belongs"
        )))
    }
}

/// What the query does, as a message has it.
impl fmt::Display for Query {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let code = self.function().code();
        match self {
            Self::Read(read) => write!(f, "read {read} (function {code})"),
            Self::Write(write) => write!(f, "write {write} (function {code})"),
            Self::Both { write, read } => {
                write!(f, "write {write} and read {read} (function {code})")
            }
        }
    }
}

/// What follows the function code of an answer, if that is the one asked for.
pub(super) fn expect(function: Function, pdu: &[u8]) -> Result<&[u8], Fault> {
    let code = function.code();
    match *pdu {
        [given, ref data @ ..] if given == code => Ok(data),
        [given, exception] if given == code | EXCEPTION_BIT => {
            Err(Fault::Refused(Exception(exception)))
        }
        [given, ..] => Err(Fault::Malformed(format!(
            "its answer has the function code {given} with {} bytes of data, where {code} was asked for",
            pdu.len() - 1
        ))),
        [] => Err(Fault::Malformed("its answer is empty".to_owned())),
    }
}

/// How long the whole answer to a request with `function` is, as far as that can be told from its beginning,
/// which begins with the function code. RTU has no other way to know before the silence.
pub(super) fn length(query: Option<Query>, beginning: &[u8]) -> Option<usize> {
    let (&code, data) = beginning.split_first()?;
    if code & EXCEPTION_BIT != 0 {
        return Some(2);
    }
    match query? {
        Query::Read(_) | Query::Both { .. } => Some(2 + usize::from(*data.first()?)),
        Query::Write(_) => Some(5),
    }
}

fn append_word(word: usize, pdu: &mut Vec<u8>) {
    let word = u16::try_from(word).expect("a table has 65,536 elements");
    pdu.extend_from_slice(&word.to_be_bytes());
}

fn append_span(span: Span, pdu: &mut Vec<u8>) {
    append_word(span.first, pdu);
    append_word(span.count, pdu);
}

fn append_values(write: Block, sends: &[u8], pdu: &mut Vec<u8>) {
    let span = write.span();
    append_span(span, pdu);
    let bytes = (span.count * write.table.width()).div_ceil(8);
    pdu.push(u8::try_from(bytes).expect("the limits keep it below"));
    let values = &sends[write.byte..][..write.bytes];
    if write.table.is_bits() {
        let begin = pdu.len();
        pdu.resize(begin + bytes, 0);
        take_bits(values, 0, span.count, &mut pdu[begin..]);
    } else {
        pdu.extend_from_slice(values);
        // The second half of a last register that is no part of the image.
        pdu.resize(pdu.len() + bytes - write.bytes, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fieldbus::modbus::{Identification, Map, Side, Tables, answer};
    use proptest::prelude::*;

    const HOLDING: Table = Table::HoldingRegisters;

    fn block(table: Table, first: usize, byte: usize, bytes: usize) -> Block {
        Block {
            table,
            first,
            byte,
            bytes,
        }
    }

    #[test]
    fn an_image_is_split_at_the_limits_of_each_function() {
        let write = block(HOLDING, 10, 0, 400);
        let parts = queries(&[], &[write], true);
        let spans = |queries: &[Query]| -> Vec<(usize, usize)> {
            queries
                .iter()
                .map(|query| {
                    let (Query::Read(block) | Query::Write(block)) = query else {
                        panic!("{query}");
                    };
                    (block.span().first, block.span().count)
                })
                .collect()
        };
        assert_eq!(spans(&parts), [(10, 123), (133, 77)]);
        let coils = queries(&[], &[block(Table::Coils, 3, 0, 300)], true);
        assert_eq!(spans(&coils), [(3, 1968), (1971, 432)]);
        let inputs = queries(&[block(Table::DiscreteInputs, 0, 0, 251)], &[], true);
        assert_eq!(spans(&inputs), [(0, 2000), (2000, 8)]);
        let odd = queries(&[block(Table::InputRegisters, 0, 0, 253)], &[], true);
        assert_eq!(spans(&odd), [(0, 125), (125, 2)]);
        assert!(queries(&[block(HOLDING, 0, 0, 0)], &[], true).is_empty());
    }

    #[test]
    fn one_request_writes_and_reads_where_both_are_holding_registers() {
        let (read, write) = (block(HOLDING, 0, 0, 128), block(HOLDING, 1024, 0, 128));
        let both = queries(&[read], &[write], true);
        assert_eq!(both, [Query::Both { write, read }]);
        let apart = queries(&[read], &[write], false);
        assert_eq!(apart, [Query::Write(write), Query::Read(read)]);
        let inputs = block(Table::InputRegisters, 0, 0, 128);
        let apart = queries(&[inputs], &[write], true);
        assert_eq!(apart, [Query::Write(write), Query::Read(inputs)]);
        let long = queries(&[read], &[block(HOLDING, 1024, 0, 244)], true);
        assert_eq!(long.len(), 2);
        assert_eq!(
            long[0].to_string(),
            "write holding-register offset:1024 (4x01025) to 1144 and read holding-register offset:0 \
             (4x00001) to 63 (function 23)"
        );
    }

    /// Both halves of the codec, each against the other.
    #[test]
    fn a_server_answers_what_a_client_asks() {
        let image: Vec<u8> = (0..=255).chain(0..=254).collect();
        for (reads, writes, combine) in [
            (
                block(HOLDING, 0, 0, 511),
                block(HOLDING, 1024, 0, 511),
                true,
            ),
            (
                block(HOLDING, 0, 0, 511),
                block(HOLDING, 1024, 0, 511),
                false,
            ),
            (
                block(Table::Coils, 0, 0, 511),
                block(Table::Coils, 16_384, 0, 511),
                true,
            ),
        ] {
            let (mut held, mut read) = (vec![0; 512], vec![0; 511]);
            for query in queries(&[reads], &[writes], combine) {
                let mut tables = Tables {
                    map: Map {
                        input: Side::Holds,
                        window: Some(1024),
                    },
                    sends: &image,
                    holds: &mut held,
                    holds_len: 511,
                };
                let (mut request, mut reply) = (Vec::new(), Vec::new());
                query.append(&image, &mut request);
                assert!(request.len() <= 253, "{query}");
                let identification = Identification::default();
                let done = answer(&request, &mut tables, &identification, &mut reply);
                assert_eq!(done.refused, None, "{query}");
                assert_eq!(length(Some(query), &reply), Some(reply.len()), "{query}");
                query.take(&reply, &mut read).expect("the right answer");
            }
            assert_eq!(read, image);
            assert_eq!(held[..511], image);
        }
    }

    #[test]
    fn a_refusal_is_no_malformed_answer() {
        let query = Query::Read(block(HOLDING, 0, 0, 2));
        let refused = query.take(&[0x83, 2], &mut [0, 0]);
        assert_eq!(refused, Err(Fault::Refused(Exception(2))));
        for wrong in [
            &[][..],
            &[0x83],
            &[0x83, 2, 0],
            &[4, 2, 0, 0],
            &[3],
            &[3, 2, 0],
            &[3, 2, 0, 0, 0],
            &[3, 4, 0, 0, 0, 0],
            &[3, 1, 0, 0],
        ] {
            let taken = query.take(wrong, &mut [0, 0]);
            assert!(matches!(taken, Err(Fault::Malformed(_))), "{wrong:?}");
        }
        let query = Query::Write(block(HOLDING, 1, 0, 2));
        assert_eq!(query.take(&[16, 0, 1, 0, 1], &mut []), Ok(()));
        for wrong in [&[16, 0, 1, 0, 2][..], &[16, 0, 1, 0], &[16, 0, 1, 0, 1, 0]] {
            let taken = query.take(wrong, &mut []);
            assert!(matches!(taken, Err(Fault::Malformed(_))), "{wrong:?}");
        }
    }

    proptest! {
        #[test]
        fn nothing_that_a_server_says_makes_a_client_panic(
            pdu in prop::collection::vec(any::<u8>(), 0..260), bytes in 1_usize..246, bits: bool, both: bool,
        ) {
            let table = if bits { Table::Coils } else { HOLDING };
            let block = block(table, 0, 0, bytes.min(242));
            let query = if both { Query::Both { write: block, read: block } } else { Query::Read(block) };
            let mut receives = vec![0; bytes];
            let _ = query.take(&pdu, &mut receives);
            let _ = Query::Write(block).take(&pdu, &mut receives);
            let _ = length(Some(query), &pdu);
        }
    }
}

//! The server's half of the codec: takes a request's PDU, reads or writes the tables, and makes the answer's
//! PDU.
//!
//! The checks and their order follow the state diagrams of the Modbus Application Protocol V1.1b3: function,
//! quantity and value, address.

use super::function::{
    EXCEPTION_BIT, QUEUED_REGISTERS, READ_BITS, READ_REGISTERS, READ_WRITE_REGISTERS, WRITE_BITS,
    WRITE_REGISTERS,
};
use super::{Exception, Function, Identification, Span, Table, Tables};

/// The effect of a request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Done {
    /// The elements that the client wrote.
    pub wrote: Option<(Table, Span)>,
    /// The elements in the answer.
    pub read: Option<(Table, Span)>,
    /// Why the request was refused, if so; it then had no effect.
    pub refused: Option<Exception>,
}

/// Answers the request `pdu`, and appends the answer's PDU to `reply`.
///
/// The functions 8, 11, 12, 20 and 21 belong to a server's state, and are refused here.
///
/// # Panics
///
/// When the PDU is empty: the framing must check that.
pub fn answer(
    pdu: &[u8],
    tables: &mut Tables<'_>,
    identification: &Identification,
    reply: &mut Vec<u8>,
) -> Done {
    let (&code, data) = pdu.split_first().expect("a PDU has a function code");
    let begin = reply.len();
    let answered = match Function::of(code) {
        None => Err(Exception::ILLEGAL_FUNCTION),
        Some(function) => {
            if function != Function::DeviceIdentification {
                reply.push(code);
            }
            act(function, data, tables, identification, reply)
        }
    };
    answered.unwrap_or_else(|exception| {
        reply.truncate(begin);
        refuse(code, exception, reply);
        Done {
            refused: Some(exception),
            ..Done::default()
        }
    })
}

/// Appends the PDU that refuses a request with this function code.
pub fn refuse(code: u8, exception: Exception, reply: &mut Vec<u8>) {
    reply.extend_from_slice(&[code | EXCEPTION_BIT, exception.0]);
}

/// The elements that a request names, in the order of its PDU; none for an incomplete one, and for functions without a table.
pub(super) fn named(pdu: &[u8]) -> impl Iterator<Item = (Table, Span)> + use<> {
    use Table::{Coils, DiscreteInputs, HoldingRegisters, InputRegisters};

    let data = pdu.get(1..).unwrap_or_default();
    let function = pdu.first().and_then(|code| Function::of(*code));
    let at = |table, first: usize, count: Option<usize>| {
        let word_at = |at: usize| data.get(at..at + 2).map(|_| word(data, at));
        let count = count.map_or_else(|| word_at(first + 2), Some);
        let span = word_at(first).zip(count);
        span.map(|(first, count)| (table, Span { first, count }))
    };
    let both = match function {
        Some(Function::ReadCoils | Function::WriteCoils) => [at(Coils, 0, None), None],
        Some(Function::WriteCoil) => [at(Coils, 0, Some(1)), None],
        Some(Function::ReadDiscreteInputs) => [at(DiscreteInputs, 0, None), None],
        Some(Function::ReadInputRegisters) => [at(InputRegisters, 0, None), None],
        Some(Function::ReadHoldingRegisters | Function::WriteRegisters) => {
            [at(HoldingRegisters, 0, None), None]
        }
        Some(Function::WriteRegister | Function::MaskWriteRegister | Function::ReadFifoQueue) => {
            [at(HoldingRegisters, 0, Some(1)), None]
        }
        Some(Function::ReadWriteRegisters) => {
            [at(HoldingRegisters, 0, None), at(HoldingRegisters, 4, None)]
        }
        _ => [None, None],
    };
    both.into_iter().flatten()
}

/// Takes the last register, or the last eight bits, out of the answer whose PDU begins at `at` and ends with `bytes`. Answers
/// of functions that read no elements stay as they are.
pub(super) fn shorten(bytes: &mut Vec<u8>, at: usize) {
    let width = match bytes.get(at).and_then(|code| Function::of(*code)) {
        Some(Function::ReadCoils | Function::ReadDiscreteInputs) => 1,
        Some(
            Function::ReadHoldingRegisters
            | Function::ReadInputRegisters
            | Function::ReadWriteRegisters,
        ) => 2,
        _ => return,
    };
    bytes[at + 1] -= width;
    bytes.truncate(bytes.len() - usize::from(width));
}

/// The length of the PDU of a request that starts like this, as soon as it can be told; in a stream nothing
/// else delimits RTU. Functions of the standard that are refused here have one as well, if it is fixed.
pub(super) fn length(beginning: &[u8]) -> Option<usize> {
    let counted = |at: usize| Some(at + 1 + usize::from(*beginning.get(at)?));
    match *beginning.first()? {
        1..=6 | 8 => Some(5),
        7 | 11 | 12 | 17 => Some(1),
        15 | 16 => counted(5),
        20 | 21 => counted(1),
        22 => Some(7),
        23 => counted(9),
        24 => Some(3),
        43 => Some(4),
        _ => None,
    }
}

fn act(
    function: Function,
    data: &[u8],
    tables: &mut Tables<'_>,
    identification: &Identification,
    reply: &mut Vec<u8>,
) -> Result<Done, Exception> {
    match function {
        Function::ReadCoils => read(Table::Coils, READ_BITS, data, tables, reply),
        Function::ReadDiscreteInputs => read(Table::DiscreteInputs, READ_BITS, data, tables, reply),
        Function::ReadHoldingRegisters => {
            read(Table::HoldingRegisters, READ_REGISTERS, data, tables, reply)
        }
        Function::ReadInputRegisters => {
            read(Table::InputRegisters, READ_REGISTERS, data, tables, reply)
        }
        Function::WriteCoil => {
            let [first, value] = words(data)?;
            let bits = match value {
                0x0000 => [0],
                0xFF00 => [1],
                _ => return Err(Exception::ILLEGAL_DATA_VALUE),
            };
            let wrote = write_bits(Span { first, count: 1 }, &bits, tables)?;
            reply.extend_from_slice(data);
            Ok(wrote)
        }
        Function::WriteRegister => {
            let [first, _] = words(data)?;
            let wrote = write_registers(Span { first, count: 1 }, &data[2..], tables)?;
            reply.extend_from_slice(data);
            Ok(wrote)
        }
        Function::WriteCoils => {
            let (span, values) = many(data)?;
            let fits = (1..=WRITE_BITS).contains(&span.count);
            if !fits || values.len() != span.count.div_ceil(8) {
                return Err(Exception::ILLEGAL_DATA_VALUE);
            }
            let wrote = write_bits(span, values, tables)?;
            reply.extend_from_slice(&data[..4]);
            Ok(wrote)
        }
        Function::WriteRegisters => {
            let (span, values) = many(data)?;
            let fits = (1..=WRITE_REGISTERS).contains(&span.count);
            if !fits || values.len() != span.count * 2 {
                return Err(Exception::ILLEGAL_DATA_VALUE);
            }
            let wrote = write_registers(span, values, tables)?;
            reply.extend_from_slice(&data[..4]);
            Ok(wrote)
        }
        Function::MaskWriteRegister => {
            let [first, ..] = words::<3>(data)?;
            let span = Span { first, count: 1 };
            let before = reply.len();
            tables.read(Table::HoldingRegisters, span, reply)?;
            let is = [reply[before], reply[before + 1]];
            reply.truncate(before);
            let [and, or] = [2, 4].map(|at| [data[at], data[at + 1]]);
            let new = [0, 1].map(|byte| (is[byte] & and[byte]) | (or[byte] & !and[byte]));
            let wrote = write_registers(span, &new, tables)?;
            reply.extend_from_slice(data);
            Ok(wrote)
        }
        Function::ReadWriteRegisters => read_write(data, tables, reply),
        Function::ReadExceptionStatus => read_exception_status(data, tables, reply),
        Function::ReadFifoQueue => read_queue(data, tables, reply),
        Function::Diagnostics
        | Function::CommEventCounter
        | Function::CommEventLog
        | Function::ReadFileRecord
        | Function::WriteFileRecord => Err(Exception::ILLEGAL_FUNCTION),
        Function::ReportServerId => {
            identification.answer_server_id(data, reply)?;
            Ok(Done::default())
        }
        Function::DeviceIdentification => {
            identification.answer(data, reply)?;
            Ok(Done::default())
        }
    }
}

/// The data as words.
fn words<const N: usize>(data: &[u8]) -> Result<[usize; N], Exception> {
    if data.len() != 2 * N {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    Ok(std::array::from_fn(|index| word(data, 2 * index)))
}

fn word(data: &[u8], at: usize) -> usize {
    usize::from(u16::from_be_bytes([data[at], data[at + 1]]))
}

/// The data of a request that writes several elements: the elements, and their values.
fn many(data: &[u8]) -> Result<(Span, &[u8]), Exception> {
    let Some((head, values)) = data.split_first_chunk::<5>() else {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    };
    if values.len() != usize::from(head[4]) {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    let (first, count) = (word(head, 0), word(head, 2));
    Ok((Span { first, count }, values))
}

fn read(
    table: Table,
    most: usize,
    data: &[u8],
    tables: &Tables<'_>,
    reply: &mut Vec<u8>,
) -> Result<Done, Exception> {
    let [first, count] = words(data)?;
    if !(1..=most).contains(&count) {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    read_counted(table, Span { first, count }, tables, reply)
}

/// Appends elements, preceded by their byte count.
fn read_counted(
    table: Table,
    span: Span,
    tables: &Tables<'_>,
    reply: &mut Vec<u8>,
) -> Result<Done, Exception> {
    let bytes = (span.count * table.width()).div_ceil(8);
    reply.push(u8::try_from(bytes).expect("the limits keep it below"));
    tables.read(table, span, reply)?;
    Ok(Done {
        read: Some((table, span)),
        ..Done::default()
    })
}

fn write_bits(span: Span, values: &[u8], tables: &mut Tables<'_>) -> Result<Done, Exception> {
    tables.put(Table::Coils, span, values)?;
    Ok(wrote(Table::Coils, span))
}

fn write_registers(span: Span, values: &[u8], tables: &mut Tables<'_>) -> Result<Done, Exception> {
    tables.put(Table::HoldingRegisters, span, values)?;
    Ok(wrote(Table::HoldingRegisters, span))
}

/// The effect of a request that wrote these elements.
fn wrote(table: Table, span: Span) -> Done {
    Done {
        wrote: Some((table, span)),
        ..Done::default()
    }
}

fn read_write(
    data: &[u8],
    tables: &mut Tables<'_>,
    reply: &mut Vec<u8>,
) -> Result<Done, Exception> {
    let Some((head, values)) = data.split_first_chunk::<9>() else {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    };
    let reads = Span {
        first: word(head, 0),
        count: word(head, 2),
    };
    let writes = Span {
        first: word(head, 4),
        count: word(head, 6),
    };
    let fits = (1..=READ_REGISTERS).contains(&reads.count)
        && (1..=READ_WRITE_REGISTERS).contains(&writes.count);
    let counted = usize::from(head[8]);
    if !fits || counted != writes.count * 2 || values.len() != counted {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    // Write nothing if the read is impossible.
    tables.check_read(Table::HoldingRegisters, reads)?;
    let wrote = write_registers(writes, values, tables)?;
    let read = read_counted(Table::HoldingRegisters, reads, tables, reply)?;
    Ok(Done {
        read: read.read,
        ..wrote
    })
}

fn read_exception_status(
    data: &[u8],
    tables: &Tables<'_>,
    reply: &mut Vec<u8>,
) -> Result<Done, Exception> {
    let status = tables.map.exception_status();
    let (table, span) = status.ok_or(Exception::ILLEGAL_FUNCTION)?;
    if !data.is_empty() {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    tables.read(table, span, reply)?;
    Ok(Done {
        read: Some((table, span)),
        ..Done::default()
    })
}

/// Reads a queue: a register that counts those behind it. Reading takes nothing out of it.
fn read_queue(data: &[u8], tables: &Tables<'_>, reply: &mut Vec<u8>) -> Result<Done, Exception> {
    const TABLE: Table = Table::HoldingRegisters;

    let queues = tables.map.queues();
    if queues.is_empty() {
        return Err(Exception::ILLEGAL_FUNCTION);
    }
    let [first] = words(data)?;
    if !queues.contains(&first) {
        return Err(Exception::ILLEGAL_DATA_ADDRESS);
    }
    let begin = reply.len();
    reply.extend_from_slice(&[0; 2]);
    tables.read(TABLE, Span { first, count: 1 }, reply)?;
    let queued = word(reply, begin + 2);
    if queued > QUEUED_REGISTERS {
        return Err(Exception::ILLEGAL_DATA_VALUE);
    }
    let count = 1 + queued;
    let bytes = u16::try_from(2 * count).expect("the limit keeps it below");
    reply.truncate(begin);
    reply.extend_from_slice(&bytes.to_be_bytes());
    let span = Span { first, count };
    tables.read(TABLE, span, reply)?;
    Ok(Done {
        read: Some((TABLE, span)),
        ..Done::default()
    })
}

#[cfg(test)]
mod tests;

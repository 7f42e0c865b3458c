use super::*;
use crate::hex;
use crate::szl::{self, Identity};

/// Inputs that count up, outputs and DB 1 on the same bytes, four bytes of flags; one job after another.
#[derive(Default)]
struct Bytes {
    outputs: [u8; 32],
    jobs: usize,
}

const INPUTS: [u8; 8] = [0, 1, 2, 3, 4, 5, 6, 7];

impl Memory for Bytes {
    fn read(&mut self, object: Object, range: Range<usize>) -> Result<&[u8], ReturnCode> {
        let all = match object {
            Object::Inputs => &INPUTS[..],
            Object::Outputs | Object::Block(1) => &self.outputs[..],
            _ => return Err(ReturnCode::MISSING),
        };
        all.get(range).ok_or(ReturnCode::ADDRESS)
    }

    fn write(&mut self, object: Object, first: usize, values: &[u8]) -> Result<(), ReturnCode> {
        let outputs = match object {
            Object::Outputs | Object::Block(1) => &mut self.outputs,
            Object::Inputs => return Err(ReturnCode::ACCESS),
            _ => return Err(ReturnCode::MISSING),
        };
        let outputs = outputs.get_mut(first..first + values.len());
        outputs.ok_or(ReturnCode::ADDRESS)?.copy_from_slice(values);
        Ok(())
    }

    fn write_bit(
        &mut self,
        object: Object,
        byte: usize,
        bit: u8,
        on: bool,
    ) -> Result<(), ReturnCode> {
        let before = self.outputs.get(byte).copied();
        let before = before.ok_or(ReturnCode::ADDRESS)?;
        let value = before & !(1 << bit) | u8::from(on) << bit;
        self.write(object, byte, &[value])
    }

    fn done(&mut self) {
        self.jobs += 1;
    }

    fn blocks(&self) -> &[(u16, usize)] {
        &[(1, 32), (300, 10)]
    }
}

struct Line {
    conversation: ServerSession,
    memory: Bytes,
    facts: Facts,
}

impl Line {
    fn new() -> Self {
        Self {
            conversation: ServerSession::default(),
            memory: Bytes::default(),
            facts: Facts {
                identity: Identity::of_driver("Test rig"),
                pdu: 480,
                clients: 32,
                epoch: Facts::NEVER_SET,
            },
        }
    }

    /// A client after negotiation.
    fn agreed(pdu: u16) -> Self {
        let mut line = Self::new();
        line.ask("03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a");
        let [high, low] = pdu.to_be_bytes();
        line.job(&format!(
            "32 01 0000 0001 0008 0000 f0 00 0001 0001 {high:02x}{low:02x}"
        ));
        line
    }

    fn try_ask(&mut self, bytes: &[u8]) -> Result<(usize, Vec<u8>), ProtocolError> {
        let mut reply = Vec::new();
        let (memory, facts) = (&mut self.memory, &self.facts);
        let taken = self
            .conversation
            .packet(Nanos::ZERO, bytes, facts, memory, &mut reply)?;
        Ok((taken, reply))
    }

    /// Sends a whole packet, and returns the answer.
    #[track_caller]
    fn ask(&mut self, packet: &str) -> Vec<u8> {
        let packet = hex(packet);
        let (taken, reply) = self.try_ask(&packet).expect("nothing is wrong");
        assert_eq!(taken, packet.len());
        reply
    }

    /// Sends a PDU, and returns the PDU of the answer.
    #[track_caller]
    fn job(&mut self, unit: &str) -> Vec<u8> {
        let unit = hex(unit);
        let mut packet = Vec::new();
        let begin = transport::begin_data(&mut packet);
        packet.extend(unit);
        transport::end_data(begin, 13, &mut packet);
        let (_, reply) = self.try_ask(&packet).expect("nothing is wrong");
        let read = transport::read(&reply).expect("an answer");
        let Some((length, Tpdu::Data { last: true, bytes })) = read else {
            panic!("{reply:02x?}");
        };
        assert_eq!(length, reply.len());
        bytes.to_vec()
    }

    /// Sends a job with these parameters and data.
    #[track_caller]
    fn do_job(&mut self, parameters: &str, data: &str) -> Vec<u8> {
        let lengths = [parameters, data].map(|text| hex(text).len());
        let [p, d] = lengths;
        self.job(&format!(
            "32 01 0000 0007 {p:04x} {d:04x} {parameters} {data}"
        ))
    }
}

/// The PDU of an answer to job 7.
fn answer(error: &str, parameters: &str, data: &str) -> Vec<u8> {
    let [p, d] = [parameters, data].map(|text| hex(text).len());
    hex(&format!(
        "32 03 0000 0007 {p:04x} {d:04x} {error} {parameters} {data}"
    ))
}

fn refusal(error: &str) -> Vec<u8> {
    hex(&format!("32 02 0000 0007 0000 0000 {error}"))
}

#[test]
fn the_captured_conversation_goes_as_it_went() {
    let mut line = Line::new();
    let confirm = line.ask("03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a");
    assert_eq!(
        confirm,
        hex("03 00 00 16 11 d0 0001 0001 00 c0 01 0a c1 02 0100 c2 02 0101")
    );
    assert_eq!(line.conversation.called().slot(), Some((0, 1)));
    let agreed = line.ask("03 00 00 19 02 f0 80 32 01 0000 0001 0008 0000 f0 00 0001 0001 01e0");
    assert_eq!(
        agreed,
        hex("03 00 00 1b 02 f0 80 32 03 0000 0001 0008 0000 00 00 f0 00 0001 0001 01e0")
    );
    let written = line
        .job("32 01 0000 0003 000e 0006 05 01 12 0a 10 02 0002 0001 84 000010 00 04 0010 aa bb");
    assert_eq!(written, hex("32 03 0000 0003 0002 0001 00 00 05 01 ff"));
    let read = line.job("32 01 0000 0002 000e 0000 04 01 12 0a 10 02 0004 0001 84 000000");
    assert_eq!(
        read,
        hex("32 03 0000 0002 0002 0008 00 00 04 01 ff 04 0020 0000aabb")
    );
    assert_eq!(line.memory.jobs, 3);
}

#[test]
fn the_shorter_length_is_agreed_and_one_without_room_refused() {
    for (asked, agreed) in [(64, "0040"), (240, "00f0"), (480, "01e0"), (960, "01e0")] {
        let mut line = Line::agreed(240);
        let reply = line.do_job(&format!("f0 00 ffff 0000 {asked:04x}"), "");
        let parameters = format!("f0 00 0008 0001 {agreed}");
        assert_eq!(reply, answer("0000", &parameters, ""));
    }
    let mut line = Line::agreed(240);
    assert_eq!(line.do_job("f0 00 0001 0001 003f", ""), refusal("8500"));
    assert_eq!(line.do_job("f0 00 0001 0001", ""), refusal("8500"));
}

#[test]
fn several_items_of_any_type_are_one_job_with_a_code_each() {
    let mut line = Line::agreed(480);
    let reply = line.do_job(
        "05 05 12 0a 10 02 0003 0001 84 000000 12 0a 10 01 0001 0000 82 000043 \
         12 0a 10 04 0001 0000 81 000000 12 0a 10 08 0001 0001 84 000050 \
         12 0a 10 05 0001 0009 84 000000",
        "00 04 0018 0a0b0c 00 00 03 0001 01 00 00 04 0010 aabb 00 07 0004 3f800000 00 05 0010 0001",
    );
    assert_eq!(reply, answer("0000", "05 05", "ff ff 03 ff 0a"));
    assert_eq!(line.memory.outputs[..10], [10, 11, 12, 0, 0, 0, 0, 0, 8, 0]);
    assert_eq!(line.memory.outputs[10..14], [0x3F, 0x80, 0, 0]);
    let reply = line.do_job(
        "04 06 12 0a 10 02 0003 0001 84 000000 12 0a 10 01 0001 0000 82 000043 \
         12 0a 10 04 0001 0000 81 000008 12 0a 10 08 0001 0001 84 000050 \
         12 0a 10 02 0002 0000 81 000038 12 0a 10 02 0001 0000 83 000000",
        "",
    );
    assert_eq!(
        reply,
        answer(
            "0000",
            "04 06",
            "ff 04 0018 0a0b0c 00 ff 03 0001 01 00 ff 04 0010 0102 ff 07 0004 3f800000 \
             05 00 0000 0a 00 0000"
        )
    );
    assert_eq!(line.memory.jobs, 3);
}

#[test]
fn clearing_a_bit_leaves_its_neighbours() {
    let mut line = Line::agreed(480);
    line.memory.outputs[2] = 0xFF;
    let bit = "05 01 12 0a 10 01 0001 0001 84 000015";
    assert_eq!(
        line.do_job(bit, "00 03 0001 00"),
        answer("0000", "05 01", "ff")
    );
    assert_eq!(line.memory.outputs[2], 0xDF);
    line.do_job(bit, "00 03 0001 80");
    assert_eq!(line.memory.outputs[2], 0xFF, "whatever is not 0 is 1");
}

#[test]
fn data_of_another_length_than_the_item_are_inconsistent() {
    let mut line = Line::agreed(480);
    for data in ["00 04 0010 aabb", "00 04 0000", "00 09 0005 0102030405"] {
        let reply = line.do_job("05 01 12 0a 10 02 0004 0001 84 000000", data);
        assert_eq!(reply, answer("0000", "05 01", "07"), "{data}");
    }
    assert_eq!(line.memory.outputs, [0; 32]);
}

#[test]
fn what_does_not_add_up_is_refused_whole_and_nothing_is_written() {
    let mut line = Line::agreed(480);
    let item = "12 0a 10 02 0002 0001 84 000000";
    for (parameters, data) in [
        (format!("05 02 {item}"), "00 04 0010 aabb"),
        (format!("05 ff {item}"), "00 04 0010 aabb"),
        (format!("05 01 {item} 00"), "00 04 0010 aabb"),
        (format!("05 02 {item} {item}"), "00 04 0010 aabb"),
        (format!("05 01 {item}"), "00 04 0010 aa"),
        (format!("05 01 {item}"), ""),
        (format!("05 01 {item}"), "00 04 ffff aabb"),
        (format!("05 01 {item}"), "00 04 0010 aabb 0000"),
        ("05".to_owned(), ""),
        ("04 01".to_owned(), ""),
        (format!("04 ff {item}"), ""),
        (format!("04 00 {item}"), ""),
        ("04 01 13 0a 10 02 0002 0001 84 000000".to_owned(), ""),
        ("04 01 12 ff 10 02 0002 0001 84 000000".to_owned(), ""),
    ] {
        assert_eq!(
            line.do_job(&parameters, data),
            refusal("8500"),
            "{parameters}"
        );
    }
    assert_eq!(line.memory.outputs, [0; 32]);
    assert_eq!(line.memory.jobs, 1, "none of them counts as a job");
}

#[test]
fn an_answer_that_would_be_too_long_is_refused_before_anything_is_read() {
    let mut line = Line::agreed(64);
    let item = "12 0a 10 02 0016 0001 84 000000";
    assert_eq!(line.do_job(&format!("04 02 {item} {item}"), "").len(), 12);
    let fits = line.do_job(&format!("04 01 {item}"), "");
    assert_eq!(fits.len(), 14 + 4 + 22);
    let long = hex(&format!("05 01 {item}")).len();
    assert!(10 + long <= 64);
    let over = "00 ".repeat(60);
    assert_eq!(line.do_job("05 00", &over), refusal("8500"));
}

#[test]
fn a_job_without_items_is_answered_without_data() {
    let mut line = Line::agreed(480);
    assert_eq!(line.do_job("04", ""), answer("0000", "04 00", ""));
    assert_eq!(line.do_job("04 00", ""), answer("0000", "04 00", ""));
}

#[test]
fn what_the_server_cannot_do_is_refused_and_the_connection_stays() {
    let mut line = Line::agreed(480);
    for parameters in [
        // Stop, start, upload, download.
        "29 00 00 00 00 00 09 50 5f 50 52 4f 47 52 41 4d",
        "28 00 00 00 00 00 00 fd 00 00 09 50 5f 50 52 4f 47 52 41 4d",
        "1d 00 00 00 00 00 00 00",
        "1a 00",
        "99",
    ] {
        assert_eq!(line.do_job(parameters, ""), refusal("8104"), "{parameters}");
    }
    assert_eq!(line.do_job("", ""), refusal("8500"));
    assert_eq!(line.do_job("04 00", ""), answer("0000", "04 00", ""));
    let mut line = Line::new();
    line.ask("03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a");
    let early = line.do_job("04 01 12 0a 10 02 0002 0001 84 000000", "");
    assert_eq!(early, refusal("8104"), "before a length is agreed");
}

#[test]
fn a_message_in_pieces_is_one_message_and_an_endless_one_none() {
    let unit = hex("32 01 0000 0007 000e 0000 04 01 12 0a 10 02 0004 0000 81 000000");
    let packet = |last: bool, bytes: &[u8]| {
        let length = 7 + u8::try_from(bytes.len()).expect("short");
        let end = if last { 0x80 } else { 0 };
        [&[3, 0, 0, length, 2, 0xF0, end][..], bytes].concat()
    };
    for cut in 1..=unit.len() {
        let mut line = Line::agreed(480);
        for _ in 0..2 {
            let first = line.try_ask(&packet(false, &unit[..cut]));
            assert_eq!(first, Ok((7 + cut, Vec::new())));
            let (_, reply) = line.try_ask(&packet(true, &unit[cut..])).expect("right");
            assert_eq!(reply[7..], answer("0000", "04 01", "ff 04 0020 00010203"));
        }
    }
    let mut line = Line::agreed(480);
    let mut pieces = 0;
    let fault = loop {
        match line.try_ask(&packet(false, &[0x32; 100])) {
            Ok(_) => pieces += 1,
            Err(fault) => break fault,
        }
    };
    assert_eq!((pieces, fault), (4, ProtocolError::Pieces(480)));
    let mut line = Line::agreed(480);
    assert_eq!(
        line.try_ask(&packet(false, &[])),
        Err(ProtocolError::Pieces(480))
    );
    let mut line = Line::agreed(480);
    assert_eq!(
        line.try_ask(&packet(true, &[])),
        Ok((7, Vec::new())),
        "a sign of life"
    );
}

#[test]
fn answers_are_cut_for_a_client_that_wants_small_packets() {
    let mut line = Line::new();
    line.ask("03 00 00 0e 09 e0 0000 0001 00 c0 01 07");
    line.job("32 01 0000 0001 0008 0000 f0 00 0001 0001 01e0");
    let list = hex(
        "03 00 00 21 02 f0 80 32 07 0000 0007 0008 0008 000112041144 0100 ff 09 0004 001c 0000",
    );
    let (_, reply) = line.try_ask(&list).expect("right");
    let Ok(Some((128 | 132, Tpdu::Data { last: false, .. }))) = transport::read(&reply) else {
        panic!("{reply:02x?}");
    };
}

#[test]
fn who_breaks_the_protocol_is_told_how() {
    for (packet, fault) in [
        ("03 00 00 07 02 f0 80", ProtocolError::NotConnected),
        (
            "03 00 00 16 11 d0 0001 0001 00 c0 01 0a c1 02 0100 c2 02 0101",
            ProtocolError::ConnectedTwice,
        ),
        ("47 45 54 20", ProtocolError::NoIsoOnTcp(0x47)),
    ] {
        assert_eq!(Line::new().try_ask(&hex(packet)), Err(fault));
    }
    for (packet, fault) in [
        (
            "03 00 00 16 11 e0 0000 0001 00 c1 02 0100 c2 02 0101 c0 01 0a",
            ProtocolError::ConnectedTwice,
        ),
        (
            "03 00 00 0b 06 80 0000 0001 00",
            ProtocolError::Disconnected(0),
        ),
        ("03 00 00 09 04 70 0001 03", ProtocolError::Rejected(3)),
        ("03 00 00 0a 02 f0 80 72 01 00", ProtocolError::S7CommPlus),
        ("03 00 00 0a 02 f0 80 32 01 00", ProtocolError::Lengths),
        (
            "03 00 00 13 02 f0 80 32 03 0000 0007 0000 0000 0000",
            ProtocolError::NotAsked,
        ),
    ] {
        assert_eq!(Line::agreed(240).try_ask(&hex(packet)), Err(fault));
    }
}

/// Sends a userdata request; returns the parameters of the answer, from the sequence number on, and its data.
#[track_caller]
fn question(line: &mut Line, parameters: &str, data: &str) -> (Vec<u8>, Vec<u8>) {
    let [p, d] = [parameters, data].map(|text| hex(text).len());
    let unit = line.job(&format!(
        "32 07 0000 0007 {p:04x} {d:04x} {parameters} {data}"
    ));
    let pdu = Pdu::read(&unit).expect("an answer");
    assert_eq!((pdu.kind, pdu.reference), (Kind::UserData, 7));
    assert_eq!(pdu.parameters[..5], hex("000112 08 12"));
    (pdu.parameters[7..].to_vec(), pdu.data.to_vec())
}

#[test]
fn a_list_that_is_too_long_is_fetched_piece_by_piece() {
    let mut whole = Vec::new();
    let mut line = Line::agreed(64);
    szl::write(0x001C, 0, &line.facts, Nanos::ZERO, &mut whole).expect("it is there");
    let (mut more, data) = question(&mut line, "000112041144 0100", "ff 09 0004 001c 0000");
    let mut fetched = data[4..].to_vec();
    let mut units = 1;
    assert_eq!(more[..3], [1, 1, 1]);
    while more[2] == 1 {
        let (next, data) = question(
            &mut line,
            &format!("000112081244 01{:02x} 00000000", more[0]),
            "0a 00 0000",
        );
        units += 1;
        assert_eq!(next[..2], [1, units]);
        assert_eq!(data[..2], [0xFF, 9]);
        fetched.extend_from_slice(&data[4..]);
        more = next;
    }
    assert_eq!(fetched, whole);
    let (none, data) = question(&mut line, "000112081244 0101 00000000", "0a 00 0000");
    assert_eq!((none, data), (hex("00 00 00 8104"), hex("0a 00 0000")));
}

#[test]
fn the_clock_and_the_blocks_are_told() {
    let mut line = Line::agreed(480);
    let (state, data) = question(&mut line, "000112041147 0100", "0a 00 0000");
    assert_eq!(state, [0; 5]);
    assert_eq!(data, hex("ff 09 000a 00 19 94 01 01 00 00 00 00 07"));
    let (_, data) = question(&mut line, "000112041143 0100", "0a 00 0000");
    assert_eq!(
        data,
        hex("ff 09 001c 30380000 30450000 30430000 30410002 30420000 30440000 30460000")
    );
    let (_, data) = question(&mut line, "000112041143 0200", "ff 09 0002 3041");
    assert_eq!(data, hex("ff 09 0008 00010005 012c0005"));
    let (_, data) = question(
        &mut line,
        "000112041143 0300",
        "ff 09 0008 3041 3030333030 41",
    );
    assert_eq!(data.len(), 4 + 78);
    assert_eq!(data[4 + 12..4 + 14], [1, 0x2C], "its number");
    assert_eq!(data[4 + 40..4 + 42], [0, 10], "its length");
}

#[test]
fn the_first_question_of_plc4x_is_answered_though_it_states_more_bytes_than_it_has() {
    let mut line = Line::agreed(480);
    let right = question(&mut line, "000112041144 0100", "ff 09 0004 0011 0000");
    let of_plc4x = question(&mut line, "000112041144 0100", "ff 09 000c 0011 0000");
    assert_eq!(right, of_plc4x);
    assert_eq!(right.0[3..], [0, 0], "no error");
    assert_eq!(right.1[4..8], [0, 0x11, 0, 0]);
}

#[test]
fn questions_without_an_answer_have_the_protocols_error() {
    let mut line = Line::agreed(480);
    for (parameters, data, error) in [
        ("000112041144 0100", "ff 09 0004 00a0 0000", "d401"),
        ("000112041144 0100", "ff 09 0004 0131 0009", "d402"),
        ("000112041144 0100", "ff 09 0002 0131", "8500"),
        ("000112041144 0100", "", "8500"),
        ("000112041143 0200", "ff 09 0002 3038", "d209"),
        ("000112041143 0300", "ff 09 0008 3041 3030303032 41", "d209"),
        ("000112041143 0300", "ff 09 0008 3041 2b30303031 41", "d209"),
        (
            "000112041147 0200",
            "ff 09 000a 00 19 94 01 01 00 00 00 00 07",
            "8104",
        ),
        ("000112041145 0100", "ff 09 0008 0000000000000000", "8104"),
        ("000112041184 0100", "ff 09 0004 001c 0000", "8500"),
        ("000112991144 0100", "ff 09 0004 001c 0000", "8500"),
        ("0001", "", "8500"),
    ] {
        let (state, data) = question(&mut line, parameters, data);
        assert_eq!(state, hex(&format!("00 00 00 {error}")), "{parameters}");
        assert_eq!(data, hex("0a 00 0000"));
    }
}

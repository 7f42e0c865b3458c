//! Functions of Modbus that a device has only if it declares them, with pymodbus at the other end.
#![allow(missing_docs, reason = "a test")]

use crate::harness::machine::Machine;
use crate::harness::{self, Absent, Test};
use crate::modbus::{open, signals};

pub(crate) const TESTS: &[(&str, Test)] = &[(
    "pymodbus_reads_files_queues_and_status_of_a_device",
    pymodbus_reads_files,
)];

/// A device with files, a queue, eight bits of status and counters, as few devices have over TCP.
fn pymodbus_reads_files() -> Result<(), Absent> {
    let mut python = harness::python_with("main", &["pymodbus"])?;
    let server = "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\nmax_age = \"1h\"\nfiles = [1, 4]\n\
                  queues = [\"400005\"]\nexception_status = \"discrete-input:9\"\ndiagnostics = true";
    let mut machine = open(server, &signals());
    machine.set("i 1", 165.0);
    machine.tick();
    let address = machine.address();
    python.args([
        "-c",
        "import sys\n\
         from pymodbus.client import ModbusTcpClient\n\
         from pymodbus.pdu.file_message import FileRecord\n\
         client = ModbusTcpClient('127.0.0.1', port=int(sys.argv[1]), retries=0)\n\
         client.connect()\n\
         def code(answer): return answer.exception_code\n\
         first = FileRecord(file_number=4, record_number=7, record_data=b'\\x06\\xaf\\x04\\xbe')\n\
         last = FileRecord(file_number=1, record_number=9999, record_data=b'ok')\n\
         assert not client.write_file_record([first, last]).isError()\n\
         def part(file, record, words): return FileRecord(file_number=file, record_number=record, record_length=2 * words)\n\
         read = client.read_file_record([part(4, 8, 1), part(1, 9998, 2)]).records\n\
         assert [record.record_data for record in read] == [b'\\x04\\xbe', b'\\0\\0ok'], read\n\
         assert code(client.read_file_record([part(2, 0, 1)])) == 2\n\
         assert code(client.read_file_record([part(1, 9999, 2)])) == 2\n\
         assert code(client.read_file_record([part(1, 0, 125)])) == 3\n\
         assert not client.write_registers(4, [3, 11, 12, 13]).isError()\n\
         for _ in range(2):\n\
         \x20   assert client.read_fifo_queue(address=4).values == [11, 12, 13]\n\
         assert code(client.read_fifo_queue(address=5)) == 2\n\
         assert not client.write_register(4, 32).isError()\n\
         assert code(client.read_fifo_queue(address=4)) == 3\n\
         assert client.read_exception_status().status == 165\n\
         assert client.diag_query_data(b'\\x12\\x34').message == b'\\x12\\x34'\n\
         assert client.diag_read_bus_exception_error_count().message == 5\n\
         assert client.diag_get_comm_event_counter().count == 9\n",
        &address.port().to_string(),
    ]);
    machine.until_the_end_of(python, Machine::tick);
    Ok(())
}

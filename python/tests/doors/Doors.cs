using System;
using System.Runtime.InteropServices;

// Doors FILE TABLES TICKS: the run of test_doors.py, in C#.
static class Doors {
    struct Signal { public IntPtr Name, Address, Type, Unit, Station; public int Slot, Edges, IsWritten, Kind; public long FailSafe; }

    [DllImport("tickbus")] static extern int tb_open(string path, string tables, out long driver);
    [DllImport("tickbus")] static extern int tb_signal_count(long driver);
    [DllImport("tickbus")] static extern int tb_signal_at(long driver, int index, out Signal signal);
    [DllImport("tickbus")] static extern IntPtr tb_buffer_of(long driver);
    [DllImport("tickbus")] static extern int tb_receive(long driver);
    [DllImport("tickbus")] static extern int tb_send(long driver);
    [DllImport("tickbus")] static extern int tb_exchange(long driver);
    [DllImport("tickbus")] static extern int tb_close(long driver);
    [DllImport("tickbus")] static extern IntPtr tb_last_error();

    static int Check(int status) {
        if (status < 0) throw new Exception(Marshal.PtrToStringAnsi(tb_last_error()));
        return status;
    }

    static long Bits(Signal signal, ulong seed) {
        if (signal.Kind != 0) return unchecked((long)seed);
        if (Marshal.PtrToStringAnsi(signal.Type) == "BOOL") return BitConverter.DoubleToInt64Bits(seed >> 40 & 1);
        return BitConverter.DoubleToInt64Bits((seed >> 20 & 0xFFFFFF) / 16.0 - 1000);
    }

    static void Main(string[] arguments) {
        long plc;
        Check(tb_open(arguments[0], arguments[1], out plc));
        IntPtr values = tb_buffer_of(plc);
        var signals = new Signal[Check(tb_signal_count(plc))];
        for (int i = 0; i < signals.Length; i++) Check(tb_signal_at(plc, i, out signals[i]));
        ulong seed = 1;
        int ticks = int.Parse(arguments[2]);
        for (int tick = 1; tick <= ticks; tick++) {
            Marshal.WriteInt64(values, 32, tick * 2000000L);
            if (tick % 2 == 1) Check(tb_receive(plc));
            foreach (var signal in signals) {
                if (signal.IsWritten == 0) continue;
                seed = unchecked(seed * 6364136223846793005UL + 1442695040888963407UL);
                if (seed >> 58 == 0) Marshal.WriteInt64(values, 88 + 8 * signal.Slot, Bits(signal, seed));
            }
            Check(tick % 2 == 1 ? tb_send(plc) : tb_exchange(plc));
        }
        Check(tb_close(plc));
    }
}

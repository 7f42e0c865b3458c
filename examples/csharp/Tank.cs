// A tank in C# on a PLC's fieldbus: README.md's tank.cfg and machine. docs/c-api.md explains how to build it.
using System;
using System.Runtime.InteropServices;

static class Tank {
    struct Signal { public IntPtr Name, Address, Type, Unit, Station; public int Slot, Edges, IsWritten, Kind; public long FailSafe; } // tb_signal

    [DllImport("tickbus")] static extern int tb_open(string path, string tables, out long driver);
    [DllImport("tickbus")] static extern int tb_find(long driver, string name, out Signal signal);
    [DllImport("tickbus")] static extern IntPtr tb_buffer_of(long driver);
    [DllImport("tickbus")] static extern int tb_receive(long driver);
    [DllImport("tickbus")] static extern int tb_send(long driver);
    [DllImport("tickbus")] static extern int tb_close(long driver);
    [DllImport("tickbus")] static extern IntPtr tb_last_error();

    static int Check(int status) {
        if (status < 0) Console.Error.WriteLine("tank: " + Marshal.PtrToStringAnsi(tb_last_error()));
        if (status < 0) Environment.Exit(1);
        return status;
    }

    static void Main(string[] arguments) {
        Check(tb_open(arguments.Length > 0 ? arguments[0] : "tank.cfg", null, out long plc));
        Func<string, int> slot = name => { Check(tb_find(plc, name, out Signal signal)); return 88 + 8 * signal.Slot; };
        int valve = slot("Valve"), low = slot("Level low"), level = slot("Level"), time = 32; // bytes of the tb_buffer
        IntPtr values = tb_buffer_of(plc);
        Func<int, double> get = at => BitConverter.Int64BitsToDouble(Marshal.ReadInt64(values, at));
        Action<int, double> set = (at, value) => Marshal.WriteInt64(values, at, BitConverter.DoubleToInt64Bits(value));
        double mm = 100;
        for (int tick = 0; tick < 500; tick++) {
            Marshal.WriteInt64(values, time, tick * 10000000L); // 10 ms a tick; needed on a stepped bus alone
            int status = Check(tb_receive(plc));
            mm += get(valve) != 0 ? 2 : -1; // your machine model
            set(low, mm < 150 ? 1 : 0);
            set(level, mm);
            Check(tb_send(plc));
            if (tick % 50 == 0) Console.WriteLine("{0,3}  {1,5:0.0} mm  valve {2}  status {3}", tick, mm, get(valve), status);
        }
        Check(tb_close(plc));
    }
}

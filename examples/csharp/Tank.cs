// A tank in C# on a PLC's fieldbus: README.md's tank.cfg and machine. docs/c-api.md tells how to build it.
using System;
using System.Runtime.InteropServices;

static class Tank {
    // tb_signal; and where tb_buffer has the simulation time and its slots.
    struct Signal { public IntPtr Name, Address, Type, Unit, Station; public int Slot, Edges, IsWritten, Kind; }
    const int SimulationTime = 32, Slots = 64;

    [DllImport("tickbus")] static extern int tb_open(string path, string tables, out long driver);
    [DllImport("tickbus")] static extern int tb_find(long driver, string name, out Signal signal);
    [DllImport("tickbus")] static extern IntPtr tb_buffer_of(long driver);
    [DllImport("tickbus")] static extern int tb_receive(long driver);
    [DllImport("tickbus")] static extern int tb_send(long driver);
    [DllImport("tickbus")] static extern int tb_close(long driver);
    [DllImport("tickbus")] static extern IntPtr tb_last_error();

    static int Check(int status) {
        if (status < 0) throw new Exception(Marshal.PtrToStringAnsi(tb_last_error()));
        return status;
    }

    static double Get(IntPtr values, Signal signal) {
        return BitConverter.Int64BitsToDouble(Marshal.ReadInt64(values, Slots + 8 * signal.Slot));
    }

    static void Set(IntPtr values, Signal signal, double value) {
        Marshal.WriteInt64(values, Slots + 8 * signal.Slot, BitConverter.DoubleToInt64Bits(value));
    }

    static void Run(string path) {
        long plc;
        Signal valve, low, level;
        Check(tb_open(path, null, out plc));
        Check(tb_find(plc, "Valve", out valve));
        Check(tb_find(plc, "Level low", out low));
        Check(tb_find(plc, "Level", out level));
        IntPtr values = tb_buffer_of(plc);
        double mm = 100;
        for (int tick = 0; tick < 500; tick++) {
            Marshal.WriteInt64(values, SimulationTime, tick * 10000000L); // 10 ms a tick; needed on a stepped bus alone
            int status = Check(tb_receive(plc));
            mm += Get(values, valve) != 0 ? 2 : -1; // your machine model
            Set(values, low, mm < 150 ? 1 : 0);
            Set(values, level, mm);
            Check(tb_send(plc));
            if (tick % 50 == 0) Console.WriteLine("{0,3}  {1,5:0.0} mm  valve {2}  status {3}", tick, mm, Get(values, valve), status);
        }
        Check(tb_close(plc));
    }

    static int Main(string[] arguments) {
        try {
            Run(arguments.Length > 0 ? arguments[0] : "tank.cfg");
            return 0;
        } catch (Exception error) {
            Console.Error.WriteLine("tank: " + error.Message);
            return 1;
        }
    }
}

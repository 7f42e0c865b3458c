// A tank in C++ on a PLC's fieldbus: README.md's tank.cfg and machine. docs/c-api.md explains how to build it.
#include <cstdio>
#include <stdexcept>
#include <tickbus.h>

static int32_t checked(int32_t status) {
    if (status < 0) throw std::runtime_error(tb_last_error());
    return status;
}

// A driver that is open as long as the object lives.
class Plc {
public:
    explicit Plc(const char *path) { checked(tb_open(path, nullptr, &driver)); }
    ~Plc() { tb_close(driver); }
    Plc(const Plc &) = delete;
    Plc &operator=(const Plc &) = delete;

    tb_signal find(const char *name) const {
        tb_signal signal;
        checked(tb_find(driver, name, &signal));
        return signal;
    }
    tb_buffer *values() const { return tb_buffer_of(driver); }
    int32_t receive() { return checked(tb_receive(driver)); }
    void send() { checked(tb_send(driver)); }

private:
    tb_driver driver;
};

int main(int count, char **arguments) {
    try {
        Plc plc(count > 1 ? arguments[1] : "tank.cfg");
        const tb_signal valve = plc.find("Valve"), low = plc.find("Level low"), level = plc.find("Level");
        tb_buffer *values = plc.values();
        double mm = 100;
        for (int tick = 0; tick < 500; tick++) {
            values->simulation_time = tick * INT64_C(10000000); // 10 ms per tick; only needed on a stepped bus
            const int status = plc.receive();
            mm += tb_get_bool(values, &valve) ? 2 : -1; // your machine model
            tb_set(values, &low, mm < 150);
            tb_set(values, &level, mm);
            plc.send();
            if (tick % 50 == 0)
                std::printf("%3d  %5.1f mm  valve %d  status %d\n", tick, mm, tb_get_bool(values, &valve), status);
        }
    } catch (const std::exception &failure) {
        std::fprintf(stderr, "tank: %s\n", failure.what());
        return 1;
    }
    return 0;
}

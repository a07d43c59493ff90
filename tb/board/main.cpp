// Runs a Verilated board for ever: its clock, its serial line on a pty, its sensor's lines.
//
//   --library FILE   of vrscan.scene.library
//   --port LINK      becomes a link to the pty
//   --status FILE    rewritten as it runs: JSON
//   --clock-hz N     of the board
//   --seconds S      stops after so much simulated time
//   --real-time      not faster than that
//   +name=value      is the design's
//
// It ends on SIGINT or SIGTERM, and takes the link away.  SIGUSR1 stops the mirror where it is.

#include <sys/file.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <thread>

#include "sensor.h"
#include "serial.h"
#include "top.h"  // the top: Top, of its verilated header
#include "verilated.h"

namespace {

constexpr int64_t kClocks = 512;  // between two looks at the pty
constexpr double kStatusS = 0.05, kReportS = 5.0;

volatile std::sig_atomic_t stopped = 0, stalled = 0;

double now_s() {
  using namespace std::chrono;
  return duration<double>(steady_clock::now().time_since_epoch()).count();
}

struct Options {
  std::string library, port, status;
  double clock_hz = 100e6, seconds = 0.0;
  bool real_time = false;

  Options(int count, char** words) {
    for (int k = 1; k < count; ++k) {
      const std::string word = words[k];
      if (word[0] == '+') continue;
      if (word == "--real-time") {
        real_time = true;
        continue;
      }
      if (k + 1 == count) throw std::runtime_error(word + ": no value");
      const std::string value = words[++k];
      if (word == "--library") library = value;
      else if (word == "--port") port = value;
      else if (word == "--status") status = value;
      else if (word == "--clock-hz") clock_hz = std::stod(value);
      else if (word == "--seconds") seconds = std::stod(value);
      else throw std::runtime_error(word + ": unknown");
    }
  }
};

// The link to the pty; only one board at a time has it.
class Link {
 public:
  Link(std::string path, const std::string& target) : path_(std::move(path)) {
    lock_ = ::open((path_ + ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (lock_ < 0) throw std::runtime_error(path_ + ".lock: " + strerror(errno));
    if (flock(lock_, LOCK_EX | LOCK_NB) != 0) {
      throw std::runtime_error(path_ + ": another board has this port");
    }
    unlink(path_.c_str());
    if (symlink(target.c_str(), path_.c_str()) != 0) {
      throw std::runtime_error(path_ + ": " + strerror(errno));
    }
  }
  ~Link() {
    unlink(path_.c_str());
    ::close(lock_);
  }
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

 private:
  std::string path_;
  int lock_;
};

std::unique_ptr<Sensor> sensor;
std::unique_ptr<Serial> serial;
double clock_s = 0.0;
int64_t lines_lost = 0;
int64_t clocks = 0, stalled_at = -1, edge_at = -1, pulse_at = -1, startup_at = -1;
int startup_most = 0;

}  // namespace

extern "C" {

void sensor_expose(double angle_rad, long long light, int exposure_clks) {
  sensor->expose(angle_rad, light * clock_s, exposure_clks * clock_s);
}
int sensor_pixel(int index) { return sensor->pixel(index); }
void sensor_lost() { ++lines_lost; }
unsigned char mirror_stalls() { return stalled_at >= 0; }
void light_is(unsigned char edge_of_index, int pulse_power, int startup) {
  if (edge_of_index) edge_at = clocks;
  if (pulse_power) pulse_at = clocks;
  if (startup) startup_at = clocks;
  startup_most = std::max(startup_most, startup);
}
int serial_step(unsigned char busy) { return serial->step(busy); }
int serial_take() { return serial->take(); }
void serial_give(int value) { serial->give(value); }

}  // extern "C"

namespace {

void write_status(const Options& options, double wall_s) {
  if (options.status.empty()) return;
  const std::string made = options.status + ".new";
  FILE* file = std::fopen(made.c_str(), "w");
  if (!file) return;
  std::fprintf(file,
               "{\"clocks\": %lld, \"wall_s\": %.3f, \"clock_hz\": %.1f, \"baud\": %lld, "
               "\"open\": %s, \"opened\": %lld, \"to_host\": %lld, \"from_host\": %lld, "
               "\"dropped\": %lld, \"unheard\": %lld, \"framing\": %lld, \"breaks\": %lld, "
               "\"lines\": %lld, \"lines_lost\": %lld, \"lines_outside\": %lld, "
               "\"stalled_at\": %lld, \"edge_at\": %lld, \"pulse_at\": %lld, "
               "\"startup_at\": %lld, \"startup_most\": %d}\n",
               (long long)clocks, wall_s, options.clock_hz, (long long)serial->baud(),
               serial->is_open() ? "true" : "false", (long long)serial->opened(),
               (long long)serial->sent(), (long long)serial->received(),
               (long long)serial->dropped(), (long long)serial->unheard(),
               (long long)serial->framing(), (long long)serial->breaks(),
               (long long)sensor->lines(), (long long)lines_lost, (long long)sensor->outside(),
               (long long)stalled_at, (long long)edge_at, (long long)pulse_at,
               (long long)startup_at, startup_most);
  std::fclose(file);
  std::rename(made.c_str(), options.status.c_str());
}

void report(const Options& options, int64_t clocks, double rate) {
  std::printf("%.4f s simulated, %.2f M clocks/s, real time / %.0f; %lld lines; %lld baud, ",
              clocks / options.clock_hz, 1e-6 * rate, options.clock_hz / std::max(rate, 1.0),
              (long long)sensor->lines(), (long long)serial->baud());
  std::printf("%lld bytes to the host, %lld from it", (long long)serial->sent(),
              (long long)serial->received());
  if (serial->dropped()) std::printf(", %lld dropped: not read", (long long)serial->dropped());
  if (lines_lost) std::printf("; %lld lines lost", (long long)lines_lost);
  std::printf("\n");
  std::fflush(stdout);
}

void run(int count, char** words) {
  const Options options(count, words);
  clock_s = 1.0 / options.clock_hz;
  sensor = std::make_unique<Sensor>(options.library);
  serial = std::make_unique<Serial>(options.clock_hz);
  std::unique_ptr<Link> link;
  if (!options.port.empty()) link = std::make_unique<Link>(options.port, serial->name());

  VerilatedContext context;
  context.commandArgs(count, words);
  Top top{&context, "board"};
  const auto clock = [&top] {
    top.clk_i = 1;
    top.eval();
    top.clk_i = 0;
    top.eval();
  };
  top.clk_i = 0;
  top.rst_i = 1;
  top.eval();
  for (int k = 0; k < 8; ++k) clock();
  top.rst_i = 0;

  const double start = now_s();
  double status_at = start, report_at = start + kReportS, report_from = start;
  int64_t report_clocks = 0;
  write_status(options, 0.0);
  std::printf("port %s\n", options.port.empty() ? serial->name().c_str() : options.port.c_str());
  std::fflush(stdout);
  const int64_t last = options.seconds > 0.0 ? std::llround(options.seconds * options.clock_hz)
                                             : INT64_MAX;
  while (!stopped && clocks < last && !context.gotFinish()) {
    const int64_t some = std::min(kClocks, last - clocks);
    for (int64_t k = 0; k < some; ++k, ++clocks) clock();
    if (stalled && stalled_at < 0) stalled_at = clocks;
    serial->serve();
    double now = now_s();
    if (options.real_time && clocks * clock_s > now - start) {
      std::this_thread::sleep_for(std::chrono::duration<double>(clocks * clock_s - (now - start)));
      now = now_s();
    }
    if (now >= status_at) {
      status_at = now + kStatusS;
      write_status(options, now - start);
    }
    if (now >= report_at) {
      report(options, clocks, (clocks - report_clocks) / (now - report_from));
      report_at = now + kReportS;
      report_from = now;
      report_clocks = clocks;
    }
  }
  const double wall = now_s() - start;
  write_status(options, wall);
  report(options, clocks, clocks / wall);
  top.final();
}

}  // namespace

int main(int count, char** words) {
  struct sigaction action {};
  action.sa_handler = [](int) { stopped = 1; };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = [](int) { stalled = 1; };
  sigaction(SIGUSR1, &action, nullptr);
  try {
    run(count, words);
  } catch (const std::exception& error) {
    std::cerr << "board: " << error.what() << "\n";
    return 2;
  }
  return 0;
}

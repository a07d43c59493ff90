// The host's end of the virtual board's serial line: a pty that behaves as a USB adapter's port.
//
// The line has the rate that the host gave its port, any rate.  A new one begins when the bytes
// that were taken for the line are out.  Bytes of the host are taken only as the line can have
// them, and wait in the pty meanwhile; bytes of the board that the host does not read are lost when
// the pty is full, and those that come while nobody has the port open.  Nothing of before is left
// for who opens it next.

#pragma once

#include <asm/termbits.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <stdexcept>
#include <string>
#include <vector>

class Serial {
 public:
  explicit Serial(double clock_hz) : clock_hz_(clock_hz) {
    master_ = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    char name[64];
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 ||
        ptsname_r(master_, name, sizeof name) != 0) {
      throw std::runtime_error(std::string("no pty: ") + strerror(errno));
    }
    name_ = name;
    leave(kBaud);
    baud_ = wanted_ = kBaud;
    step_ = step_of(kBaud);
  }
  ~Serial() { ::close(master_); }
  Serial(const Serial&) = delete;
  Serial& operator=(const Serial&) = delete;

  const std::string& name() const { return name_; }
  int64_t baud() const { return baud_; }
  bool is_open() const { return open_; }
  int64_t sent() const { return sent_; }              // to the host
  int64_t received() const { return received_; }      // from the host
  int64_t dropped() const { return dropped_; }        // the host did not read
  int64_t unheard() const { return unheard_; }        // nobody had it open
  int64_t framing() const { return framing_; }
  int64_t breaks() const { return breaks_; }
  int64_t opened() const { return opened_; }

  // Called every clock.
  int step(bool busy) {
    if (baud_ != wanted_ && !busy && to_board_.empty()) {
      baud_ = wanted_;
      step_ = step_of(baud_);
    }
    return step_;
  }
  int take() {
    if (to_board_.empty()) return -1;
    const int byte = to_board_.front();
    to_board_.pop_front();
    ++received_;
    return byte;
  }
  void give(int value) {
    breaks_ += (value & 256) != 0;
    framing_ += (value & 512) != 0;
    to_host_.push_back(value & 255);  // a break reads as 0, as of a port without PARMRK
  }

  // Moves bytes between line and pty; called every few clocks.
  void serve() {
    struct pollfd state {master_, POLLIN, 0};
    poll(&state, 1, 0);
    const bool closed = (state.revents & POLLHUP) != 0;
    if (!closed) {
      if (!open_) ++opened_;
      open_ = true;
      const int64_t speed = speed_of(master_);
      if (speed > 0) wanted_ = speed;
    }
    // What the host had written when it closed its end still goes out.
    if ((state.revents & POLLIN) && to_board_.size() < kFew && baud_ == wanted_) {
      uint8_t bytes[kFew];
      const ssize_t count = read(master_, bytes, sizeof bytes);
      if (count > 0) to_board_.insert(to_board_.end(), bytes, bytes + count);
    }
    if (closed) {
      if (open_) leave(wanted_);
      open_ = false;
      unheard_ += to_host_.size();
    } else if (!to_host_.empty()) {
      const ssize_t count = write(master_, to_host_.data(), to_host_.size());
      const int64_t done = std::max<ssize_t>(count, 0);
      sent_ += done;
      dropped_ += to_host_.size() - done;
    }
    to_host_.clear();
  }

 private:
  static constexpr size_t kFew = 32;  // bytes that are on their way to the line
  static constexpr int64_t kBaud = 9600;  // until the host says something, as of any port

  // The steps that the line's transmitter and receiver can do.
  int step_of(int64_t baud) const {
    return std::min(std::max(std::round(baud * 16777216.0 / clock_hz_), 1.0), 4194304.0);
  }

  static int64_t speed_of(int file) {
    struct termios2 state {};
    return ioctl(file, TCGETS2, &state) == 0 ? state.c_ospeed : 0;
  }

  // The port as the next one to open it finds it: raw, at this rate, and nothing to read.
  void leave(int64_t baud) {
    const int file = ::open(name_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) throw std::runtime_error(name_ + ": " + strerror(errno));
    struct termios2 state {};
    ioctl(file, TCGETS2, &state);
    state.c_iflag = 0;
    state.c_oflag = 0;
    state.c_lflag = 0;
    state.c_cflag = CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT);
    state.c_ispeed = state.c_ospeed = baud;
    state.c_cc[VMIN] = 1;
    state.c_cc[VTIME] = 0;
    ioctl(file, TCSETS2, &state);
    // The kernel passes on what is on its way when there is room: read until nothing comes.
    char bytes[4096];
    for (struct pollfd more {file, POLLIN, 0}; poll(&more, 1, 5) > 0;) {
      if (read(file, bytes, sizeof bytes) <= 0) break;
    }
    ::close(file);
  }

  double clock_hz_;
  int master_;
  std::string name_;
  bool open_ = false;
  int64_t baud_, wanted_;
  int step_;
  std::deque<uint8_t> to_board_;
  std::vector<uint8_t> to_host_;
  int64_t sent_ = 0, received_ = 0, dropped_ = 0, unheard_ = 0;
  int64_t framing_ = 0, breaks_ = 0, opened_ = 0;
};

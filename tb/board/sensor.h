// The virtual sensor's pixels: a library of noiseless lines by angle, and the noise of each.
//
// vrscan.scene.library writes the file, and vrscan.scene.sensor is what bloom() and convert() agree
// with: every operation is in float, in the same order.

#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

class Sensor {
 public:
  explicit Sensor(const std::string& path) {
    const int file = ::open(path.c_str(), O_RDONLY);
    struct stat state {};
    if (file < 0 || fstat(file, &state) != 0) throw std::runtime_error(path + ": cannot open");
    void* start = mmap(nullptr, state.st_size, PROT_READ, MAP_PRIVATE, file, 0);
    ::close(file);
    if (start == MAP_FAILED) throw std::runtime_error(path + ": cannot map");
    const char* text = static_cast<const char*>(start);
    std::istringstream words(std::string(text, strnlen(text, kHeader)));
    std::map<std::string, double> values;
    for (std::string name; words >> name;) words >> values[name];
    const auto number = [&](const char* name) {
      const auto found = values.find(name);
      if (found == values.end()) throw std::runtime_error(path + ": no " + name);
      return found->second;
    };
    angles_ = number("angles");
    length_ = number("line_length");
    first_rad_ = number("first_rad");
    step_rad_ = number("step_rad");
    rated_s_ = number("rated_s");
    exposure_s_ = number("exposure_s");
    gain_ = number("gain");
    base_ = number("offset_counts") + 0.5;
    read_variance_ = number("read_noise_e") * number("read_noise_e");
    top_count_ = number("top_count");
    least_variance_ = number("least_variance");
    full_well_e_ = number("full_well_e");
    blooming_ = number("blooming");
    spill_px_ = number("spill_px");
    spill_reach_ = number("spill_reach");
    seed_ = number("seed");
    const int64_t floats = kWords + (3 + angles_) * length_;
    if (state.st_size != kHeader + 4 * floats) throw std::runtime_error(path + ": wrong size");
    normal_ = reinterpret_cast<const float*>(text + kHeader);
    other_e_ = normal_ + kWords;
    other_offset_e_ = other_e_ + length_;
    offset_e_ = other_offset_e_ + length_;
    laser_e_ = offset_e_ + length_;
    mean_e_.resize(length_);
    shift_e_.resize(length_);
    pixels_.resize(length_);
  }

  int64_t length() const { return length_; }
  int64_t lines() const { return lines_; }
  int64_t outside() const { return outside_; }
  int pixel(int index) const { return pixels_[index]; }

  // A line: the beam's angle, the laser's power times the seconds that it was on, the exposure.
  void expose(double angle_rad, double power_s, double exposure_s) {
    const float level = power_s / rated_s_;
    const float other = exposure_s / exposure_s_;
    for (int64_t k = 0; k < length_; ++k) {
      mean_e_[k] = other * other_e_[k];
      shift_e_[k] = other * other_offset_e_[k] + offset_e_[k];
    }
    if (power_s > 0.0) {
      const double place = (angle_rad - first_rad_) / step_rad_;
      if (place >= 0.0 && place <= angles_ - 1) {
        const int64_t row = std::min<int64_t>(place, angles_ - 2);
        const float share = place - row;
        const float* low = laser_e_ + row * length_;
        const float* high = low + length_;
        for (int64_t k = 0; k < length_; ++k) {
          mean_e_[k] += level * (low[k] + share * (high[k] - low[k]));
        }
      } else {
        ++outside_;
      }
    }
    bloom();
    convert();
    ++lines_;
  }

 private:
  static constexpr int64_t kHeader = 4096;
  static constexpr int64_t kWords = 1 << 16;

  void bloom() {
    const int64_t length = length_;
    int64_t first = 0, last = length - 1;
    while (first < length && !(mean_e_[first] > full_well_e_)) ++first;
    if (first == length) return;
    while (!(mean_e_[last] > full_well_e_)) --last;
    double excess = 0.0;
    for (int64_t k = first; k <= last; ++k) excess += std::max(mean_e_[k] - full_well_e_, 0.0f);
    const double reach =
        std::min<double>(std::ceil(spill_reach_ * spill_px_ + blooming_ * excess / full_well_e_),
                         length);
    first = std::max<int64_t>(first - reach, 0);
    last = std::min<int64_t>(last + reach, length - 1);
    const float half = 0.5 * blooming_;
    const float share = -std::expm1(-1.0 / spill_px_);
    spilt_.assign(length, 0.0f);
    for (int64_t k = first; k <= last; ++k) {
      spilt_[k] = std::max(mean_e_[k] - full_well_e_, 0.0f) * half;
      mean_e_[k] = std::min(mean_e_[k], full_well_e_);
    }
    const auto walk = [&](int64_t from, int64_t to, int64_t step) {
      float walking = 0.0f;
      for (int64_t k = from; k != to; k += step) {
        const float left = std::min(walking * share, full_well_e_ - mean_e_[k]);
        mean_e_[k] += left;
        walking -= left;
        walking += spilt_[k];
      }
    };
    walk(first, last + 1, 1);
    walk(last, first - 1, -1);
  }

  // The charge of a Poisson number and read noise, by Cornish and Fisher's expansion, and its code.
  void convert() {
    const float sixth = 1.0 / 6.0;
    for (int64_t k = 0; k < length_; k += 4) {
      uint64_t word = shuffled(seed_ + kStep * ((uint64_t(lines_) << 16) + k / 4 + 1));
      for (int64_t j = k; j < std::min(k + 4, length_); ++j, word >>= 16) {
        const float z = normal_[word & 0xFFFF];
        const float mean = mean_e_[j];
        const float variance = mean + read_variance_;
        const float bend = mean / std::max(variance, least_variance_) * sixth;
        float level = std::sqrt(std::max(variance - bend * bend * 2.0f, 0.0f));
        const float curved = (z * z - 1.0f) * bend;
        level = level * z + curved + mean;
        level = level * gain_ + base_ + shift_e_[j] * gain_;
        pixels_[j] = std::min(std::max(level, 0.0f), top_count_);
      }
    }
  }

  static uint64_t shuffled(uint64_t z) {  // Steele, Lea, Flood 2014: splitmix64
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ull;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBull;
    return z ^ (z >> 31);
  }
  static constexpr uint64_t kStep = 0x9E3779B97F4A7C15ull;

  int64_t angles_, length_;
  double first_rad_, step_rad_, rated_s_, exposure_s_;
  double blooming_, spill_px_, spill_reach_;
  float gain_, base_, read_variance_, top_count_, least_variance_, full_well_e_;
  uint64_t seed_;
  const float *normal_, *other_e_, *other_offset_e_, *offset_e_, *laser_e_;
  std::vector<float> mean_e_, shift_e_, spilt_;
  std::vector<uint16_t> pixels_;
  int64_t lines_ = 0, outside_ = 0;
};

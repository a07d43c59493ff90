// The verilated mirror_loop and the simulated mirror_world behind C functions, for vrscan.engines.mirror_engine.
//
// Structs of registers go through as words of 32 bits, the lowest first; Python knows their fields,
// and says in ports.h how many words they have and where the fields of the status are, AT_*.  Time is
// in clocks since the reset.  What the loop reports is appended to the caller's arrays: lines,
// measurements, and every change of the index's samples.

#include <cstdint>
#include <memory>

#include "Vmirror_loop.h"
#include "Vmirror_loop___024root.h"
#include "Vmirror_world.h"
#include "Vmirror_world___024root.h"
#include "clock.h"
#include "ports.h"
#include "verilated.h"

ROOT_EVALUATION(Vmirror_loop)
ROOT_EVALUATION(Vmirror_world)

namespace {

// As vrscan.engines.mirror_engine knows them.
struct Line {
  int64_t line, centre_halves, clock, state, flags, confidence, angle, amplitude, word, level;
  double angle_true;
};
struct Measurement {
  int64_t clock, measured, error, level, word, phase, drive_phase;
};
struct Samples {
  int64_t clock, comparator, gate;
};

int64_t extended(uint64_t value, int width) {
  return static_cast<int64_t>(value << (64 - width)) >> (64 - width);
}

// Bits of a struct that is wider than 64.
template <typename Wide>
int64_t field(const Wide& wide, int low, int width) {
  const int last = (low + width - 1) / 32;
  unsigned __int128 bits = 0;
  for (int k = last; k >= low / 32; --k) bits = bits << 32 | wide[k];
  return static_cast<int64_t>(static_cast<uint64_t>(bits >> low % 32) & (1ull << width) - 1);
}

template <typename Row>
struct Log {
  Row* rows;
  int64_t room, count;
  void append(const Row& row) {
    if (count < room) rows[count] = row;
    ++count;
  }
};

struct World {
  double natural_offset_hz, damping_factor, jitter_s, noise_rad, mark_rad, width_rad;
  double beam_rad, ambient_mw, threshold_mw, threshold_share, hold_s;
  double startup_mw;  // light on the diode, 0 where the laser is off
  double shock_rad_per_s;  // of the first clock of a run
  double start_angle, start_velocity;
  int64_t drop_every;  // a pass over the diode, 0 for none
  int64_t seed;
};

struct Engine {
  VerilatedContext context;
  Vmirror_loop loop{&context, "loop"};
  Vmirror_world world{&context, "world"};
  int64_t clock = 0;
  int64_t centre_halves = 0;
  int64_t passes = 0;
  int64_t comparator = 0, gate = 0;
  int64_t amplitude = 0;
  bool centred = false;
  bool on_diode = false;
  bool simulated = true;

  Engine() {
    start(loop);
    start(world);
  }

  int64_t status(int low, int width) const { return field(loop.mirror_status_o, low, width); }

  void tick() {
    rise(loop);
    if (simulated) rise(world);
  }
};

}  // namespace

extern "C" {

void mirror_configure(void* handle, const uint32_t* words) {
  Vmirror_loop& loop = static_cast<Engine*>(handle)->loop;
  for (int k = 0; k < MIRROR_WORDS; ++k) loop.mirror_i[k] = *words++;
  for (int k = 0; k < MIRROR_LIMITS_WORDS; ++k) loop.mirror_limits_i[k] = *words++;
  for (int k = 0; k < MOTION_WORDS; ++k) loop.motion_i[k] = *words++;
  for (int k = 0; k < LINE_WORDS; ++k) loop.line_i[k] = *words++;
}

void mirror_world(void* handle, const World* given) {
  Vmirror_world& world = static_cast<Engine*>(handle)->world;
  world.natural_offset_hz_i = given->natural_offset_hz;
  world.damping_factor_i = given->damping_factor;
  world.jitter_s_i = given->jitter_s;
  world.noise_rad_i = given->noise_rad;
  world.mark_rad_i = given->mark_rad;
  world.width_rad_i = given->width_rad;
  world.beam_rad_i = given->beam_rad;
  world.ambient_mw_i = given->ambient_mw;
  world.threshold_mw_i = given->threshold_mw;
  world.threshold_share_i = given->threshold_share;
  world.hold_s_i = given->hold_s;
  world.startup_mw_i = given->startup_mw;
  world.shock_rad_per_s_i = given->shock_rad_per_s;
  world.start_angle_i = given->start_angle;
  world.start_velocity_i = given->start_velocity;
  world.seed_i = given->seed;
}

// Resets both, and writes the table meanwhile.
void mirror_reset(void* handle, const uint32_t* table, int64_t entries) {
  Engine& engine = *static_cast<Engine*>(handle);
  engine.loop.rst_i = 1;
  engine.world.rst_i = 1;
  engine.loop.comparator_i = 0;
  engine.loop.gate_i = 0;
  engine.loop.take_i = 0;
  for (int64_t entry = 0; entry < entries; ++entry) {
    for (int k = 0; k < TABLE_WORDS; ++k) engine.loop.table_i[k] = *table++;
    engine.tick();
  }
  for (int k = 0; k < TABLE_WORDS; ++k) engine.loop.table_i[k] = 0;
  engine.tick();
  engine.loop.rst_i = 0;
  engine.world.rst_i = 0;
  engine.clock = engine.passes = engine.comparator = engine.gate = 0;
  engine.centre_halves = engine.amplitude = 0;
  engine.on_diode = engine.centred = false;
}

void* mirror_create() { return new Engine; }

// Runs until `until`, or up to the clock in which the loop's state is `stop_state`.  With `replay`,
// `replayed` changes of the samples are taken from there instead of from the simulated mirror.
// Returns the clock reached.
int64_t mirror_run(void* handle, int64_t until, int64_t stop_state, const World* given,
                   Log<Line>* lines, Log<Measurement>* measurements, Log<Samples>* samples,
                   const Samples* replay, int64_t replayed) {
  Engine& engine = *static_cast<Engine*>(handle);
  Vmirror_loop& loop = engine.loop;
  Vmirror_world& world = engine.world;
  engine.simulated = replay == nullptr;
  mirror_world(handle, given);
  world.shock_i = given->shock_rad_per_s != 0.0;
  int64_t next = 0;
  while (replay && next < replayed && replay[next].clock < engine.clock) ++next;
  while (engine.clock < until && engine.status(AT_MIRROR_STATE) != stop_state) {
    if (replay) {
      if (next < replayed && replay[next].clock == engine.clock) {
        loop.comparator_i = replay[next].comparator;
        loop.gate_i = replay[next].gate;
        ++next;
      }
    } else {
      loop.comparator_i = world.comparator_o;
      loop.gate_i = world.gate_o;
      world.drive_i = loop.drive_o;
      world.level_i = loop.level_o;
      world.centre_i = loop.centre_o;
      world.half_i = loop.centre_half_o;
      if (world.on_diode_o != engine.on_diode) {
        engine.on_diode = world.on_diode_o;
        if (!engine.on_diode) ++engine.passes;
        world.drop_i = given->drop_every && (engine.passes + 1) % given->drop_every == 0;
      }
    }
    if (loop.comparator_i != engine.comparator || loop.gate_i != engine.gate) {
      engine.comparator = loop.comparator_i;
      engine.gate = loop.gate_i;
      samples->append({engine.clock, engine.comparator, engine.gate});
    }
    if (loop.angle_valid_o) {
      lines->append({loop.angle_line_o, engine.centre_halves, engine.clock,
                     engine.status(AT_MIRROR_STATE), loop.mirror_flags_o, loop.confidence_o,
                     extended(loop.angle_o, ANGLE_WIDTH), engine.amplitude,
                     engine.status(AT_MIRROR_WORD), loop.level_o, world.angle_true_o});
    }
    // A line's amplitude is that of the clock behind its centre.
    if (engine.centred) engine.amplitude = loop.rootp->mirror_loop__DOT__average;
    engine.centred = loop.centre_o;
    if (loop.centre_o) engine.centre_halves = 2 * engine.clock + loop.centre_half_o;
    if (loop.rootp->mirror_loop__DOT__measured) {
      measurements->append({engine.clock, engine.status(AT_MIRROR_MEASURED),
                            extended(engine.status(AT_MIRROR_ERROR), ERROR_WIDTH), loop.level_o,
                            engine.status(AT_MIRROR_WORD), engine.status(AT_MIRROR_PHASE),
                            engine.status(AT_MIRROR_DRIVE_PHASE)});
    }
    engine.tick();
    world.shock_i = 0;
    ++engine.clock;
  }
  return engine.clock;
}

int64_t mirror_state(void* handle) { return static_cast<Engine*>(handle)->status(AT_MIRROR_STATE); }
int64_t mirror_fault(void* handle) { return static_cast<Engine*>(handle)->status(AT_MIRROR_FAULT); }

void mirror_counts(void* handle, int64_t* counts) {
  const Engine& engine = *static_cast<Engine*>(handle);
  *counts++ = engine.status(AT_MISSING_COUNT);
  *counts++ = engine.status(AT_DOUBLED_COUNT);
  *counts++ = engine.status(AT_IMPOSSIBLE_COUNT);
  *counts++ = engine.status(AT_GLITCH_COUNT);
  *counts++ = engine.status(AT_OVERRUN_COUNT);
}

void mirror_destroy(void* handle) { delete static_cast<Engine*>(handle); }
}

// The verilated vrscan_chain behind three C functions, for vrscan.engines.chain_engine to call with numpy buffers.
//
// Structs go through as words of 32 bits, the lowest first; Python knows their fields, and says in
// ports.h, which is written beside the verilated model, how many words they have.  Lines go in a
// pixel a clock, with as many clocks between them as is asked for; points are taken in the clock in
// which they come.

#include <cstdint>
#include <memory>

#include "Vvrscan_chain.h"
#include "Vvrscan_chain___024root.h"
#include "clock.h"
#include "ports.h"
#include "verilated.h"

ROOT_EVALUATION(Vvrscan_chain)

namespace {

struct Engine {
  VerilatedContext context;
  Vvrscan_chain chain{&context, "chain"};
  uint32_t* results = nullptr;  // rows still to fill
  int64_t* times = nullptr;     // the clock of each
  int64_t room = 0;
  int64_t count = 0;
  int64_t clocks = 0;  // since the reset

  void clock() {
    // A point that is valid now is taken by the coming edge; outputs are registered.
    if (chain.valid_o && chain.ready_i && !chain.rst_i) {
      if (count < room) {
        for (int k = 0; k < POINT_WORDS; ++k) *results++ = chain.point_o[k];
        *times++ = clocks;
      }
      ++count;
    }
    rise(chain);
    clocks = chain.rst_i ? 0 : clocks + 1;
  }
};

}  // namespace

extern "C" {

void* engine_create(const uint32_t* configuration, const uint32_t* table, int64_t entries,
                    const uint32_t* map, int64_t nodes) {
  auto engine = std::make_unique<Engine>();
  Vvrscan_chain& chain = engine->chain;
  for (int k = 0; k < PEAK_WORDS; ++k) chain.peak_i[k] = *configuration++;
  for (int k = 0; k < GEOMETRY_WORDS; ++k) chain.geometry_i[k] = *configuration++;
  chain.free_i = *configuration++;
  chain.map_i = *configuration++;
  chain.map_i |= static_cast<uint64_t>(*configuration++) << 32;
  chain.line_start_i = 0;
  chain.line_end_i = 0;
  chain.pixel_valid_i = 0;
  chain.ready_i = 1;
  chain.hold_i = 0;
  chain.take_i = 0;
  chain.configuration_i = 0;
  chain.map_table_i = 0;
  chain.rst_i = 1;
  start(chain);
  for (int k = 0; k < 4; ++k) engine->clock();
  chain.rst_i = 0;
  // The table of free space, an entry a clock; what is left on the port writes the last one again.
  for (int64_t k = 0; k < entries; ++k) {
    const uint64_t low = *table++;
    chain.free_table_i = low | static_cast<uint64_t>(*table++) << 32;
    engine->clock();
  }
  // The correction maps in the same way, if there are any.
  for (int64_t k = 0; k < nodes; ++k) {
    const uint64_t low = *map++;
    chain.map_table_i = low | static_cast<uint64_t>(*map++) << 32;
    engine->clock();
  }
  engine->clocks = 0;
  return engine.release();
}

// Sends `lines` lines, `gap` clocks behind each, and then `idle` clocks; returns the points that
// came out meanwhile.
int64_t engine_run(void* handle, const uint16_t* pixels, const uint32_t* belongs, int64_t lines,
                   int64_t length, int64_t gap, int64_t idle, uint32_t* results, int64_t* times,
                   int64_t room) {
  Engine& engine = *static_cast<Engine*>(handle);
  Vvrscan_chain& chain = engine.chain;
  engine.results = results;
  engine.times = times;
  engine.room = room;
  engine.count = 0;
  for (int64_t line = 0; line < lines; ++line) {
    for (int k = 0; k < LINE_WORDS; ++k) chain.line_i[k] = *belongs++;
    chain.pixel_valid_i = 1;
    for (int64_t k = 0; k < length; ++k) {
      chain.line_start_i = k == 0;
      chain.line_end_i = k == length - 1;
      chain.pixel_i = *pixels++;
      engine.clock();
    }
    chain.line_start_i = 0;
    chain.line_end_i = 0;
    chain.pixel_valid_i = 0;
    for (int64_t k = 0; k < gap; ++k) engine.clock();
  }
  for (int64_t k = 0; k < idle; ++k) engine.clock();
  return engine.count;
}

void engine_destroy(void* handle) { delete static_cast<Engine*>(handle); }
}

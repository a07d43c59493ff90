// A clock of a Verilated model in one evaluation, for models that take no edge but the rising one of
// clk_i.
//
// Verilator finds an edge by the level that it kept of the evaluation before, and so asks for one at
// either level.  Where that level is the member of the root that is named here, it is written instead.
// A model that prints nothing and deletes nothing may say ROOT_EVALUATION: its root is evaluated
// without the locks and queues for that.  Both names are Verilator's own.  With one that has others
// the model is evaluated as documented, at either level.

#pragma once

template <typename Model>
void evaluate(Model& top) {
  top.eval();
}

// The symbol is null where Verilator calls it otherwise.
#define ROOT_EVALUATION(model)                                     \
  [[gnu::weak]] void model##___024root___eval(model##___024root*); \
  inline void evaluate(model& top) {                               \
    if (model##___024root___eval) {                                \
      model##___024root___eval(top.rootp);                         \
    } else {                                                       \
      top.eval();                                                  \
    }                                                              \
  }

template <typename Root>
auto forget_high(Root& root, int) -> decltype(root.__Vtrigprevexpr___TOP__clk_i__0 = 0, true) {
  root.__Vtrigprevexpr___TOP__clk_i__0 = 0;
  return true;
}

template <typename Root>
bool forget_high(Root&, long) {
  return false;
}

// Once, before the first clock: the first evaluation also initialises.
template <typename Model>
void start(Model& top) {
  top.clk_i = 0;
  top.eval();
}

// Afterwards the outputs are those of the registers behind the edge.
template <typename Model>
void rise(Model& top) {
  if (!forget_high(*top.rootp, 0)) {
    top.clk_i = 0;
    top.eval();
  }
  top.clk_i = 1;
  evaluate(top);
}

// Checks with every instruction set of this processor.
#pragma once

#include <gtest/gtest.h>

#include "runtime/base/instructions.hpp"

namespace carillon::tests {

/// Calls work() once for each set, ascending, with loops of that set.
template <typename Work>
void for_each_instruction_set(const Work& work) {
  struct Restore {
    ~Restore() { base::limit_instructions(base::Instructions::kBest); }
  } const restore;
  for (const base::Instructions set : base::list_instructions()) {
    SCOPED_TRACE(base::get_name(set));
    base::limit_instructions(set);
    ASSERT_EQ(base::find_instructions(), set);
    work();
  }
}

}  // namespace carillon::tests

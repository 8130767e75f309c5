// What an error says.
#pragma once

#include <string>

namespace carillon::tests {

/// The message of the Error that `call` throws; another kind of exception passes.
template <typename Error, typename Call>
std::string catch_message(Call&& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

}  // namespace carillon::tests

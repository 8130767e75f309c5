#include "runtime/base/sha256.hpp"

#include "runtime/base/error.hpp"

#if defined(__EMSCRIPTEN__)
#include "runtime/base/sha256_plain.hpp"
#else
#include <openssl/evp.h>
#endif

namespace carillon::base {

#if defined(__EMSCRIPTEN__)

Sha256::Sha256() : context_(new PlainSha256) {}
Sha256::~Sha256() { delete static_cast<PlainSha256*>(context_); }
void Sha256::add(std::span<const std::byte> bytes) { static_cast<PlainSha256*>(context_)->add(bytes); }
Sha256::Hash Sha256::finish() { return static_cast<PlainSha256*>(context_)->finish(); }

#else

namespace {

EVP_MD_CTX* get(void* context) { return static_cast<EVP_MD_CTX*>(context); }

}  // namespace

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  if (context_ != nullptr && EVP_DigestInit_ex(get(context_), EVP_sha256(), nullptr) == 1) return;
  EVP_MD_CTX_free(get(context_));
  throw SystemError("OpenSSL lacks SHA-256; check its installation");
}

Sha256::~Sha256() { EVP_MD_CTX_free(get(context_)); }

void Sha256::add(std::span<const std::byte> bytes) {
  if (EVP_DigestUpdate(get(context_), bytes.data(), bytes.size()) != 1) throw SystemError("SHA-256 failed");
}

Sha256::Hash Sha256::finish() {
  Hash hash{};
  if (EVP_DigestFinal_ex(get(context_), hash.data(), nullptr) != 1) throw SystemError("SHA-256 failed");
  return hash;
}

#endif

void Sha256::add(std::string_view bytes) { add(std::as_bytes(std::span(bytes.data(), bytes.size()))); }

Sha256::Hash calc_sha256(std::string_view bytes) {
  Sha256 sha;
  sha.add(bytes);
  return sha.finish();
}

std::string to_hex(std::span<const unsigned char> bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const unsigned char byte : bytes) {
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

}  // namespace carillon::base

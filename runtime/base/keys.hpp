// Keys of jobs, scenes and simulations. Each key is declared once: name, member that holds its value, range and meaning. The declaration
// reads and checks the key, describes it (--keys, tables of the docs) and writes it back. Units are the suffixes of the names; defaults are
// the initialisers of the members.
//
//   const base::Keys<Floor> kFloor{
//       {"height_m", &Floor::height_m, base::Limits{-1e4, 1e4}, "height of the floor"},
//       {"kind", &Floor::kind, kFloorKinds, "surface"},        // one of the words, in the order of the enumeration
//       {"material", "none", "name of a material"}};           // read by the caller
//   kFloor.read(object, floor);
#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::base {

/// Range of a number, or of each component of a vector; bounds are included unless `is_open`.
struct Limits {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool is_open = false;
};
inline constexpr Limits kAboveZero{0.0, std::numeric_limits<double>::infinity(), true};
constexpr Limits within(double limit) { return {-limit, limit}; }

enum class Need { optional, required };
using Need::required;

/// Row of a reference table.
struct KeyText {
  std::string name, fallback, meaning;
};
struct KeyTable {
  std::string title;
  std::vector<KeyText> rows;
};

/// The tables in Markdown, each under its title.
std::string write_key_tables(const std::vector<KeyTable>& tables);

/// Value of a member; empty optionals and texts are unset.
using KeyValue = std::variant<std::monostate, bool, long long, double, std::string, Vec3>;

/// Required values; InputError if missing or out of range.
double read_value(Object& object, const char* key, const Limits& limits, const double*);
long long read_value(Object& object, const char* key, const Limits& limits, const long long*);
bool read_value(Object& object, const char* key, const Limits& limits, const bool*);
std::string read_value(Object& object, const char* key, const Limits& limits, const std::string*);
std::filesystem::path read_value(Object& object, const char* key, const Limits& limits, const std::filesystem::path*);
Vec3 read_value(Object& object, const char* key, const Limits& limits, const Vec3*);
template <std::signed_integral Integer>
Integer read_value(Object& object, const char* key, const Limits& limits, const Integer*) {
  return static_cast<Integer>(read_value(object, key, limits, static_cast<const long long*>(nullptr)));
}
template <class V>
std::optional<V> read_value(Object& object, const char* key, const Limits& limits, const std::optional<V>*) {
  return read_value(object, key, limits, static_cast<const V*>(nullptr));
}
std::size_t read_word(Object& object, const char* key, const std::vector<std::string>& words);

template <class V>
KeyValue to_value(const V& value) {
  if constexpr (std::is_integral_v<V> && !std::is_same_v<V, bool>)
    return static_cast<long long>(value);
  else
    return value;
}
inline KeyValue to_value(const std::string& value) { return value.empty() ? KeyValue() : KeyValue(value); }
inline KeyValue to_value(const std::filesystem::path& value) { return to_value(value.string()); }
template <class V>
KeyValue to_value(const std::optional<V>& value) {
  return value ? to_value(*value) : KeyValue();
}

Json to_json(const KeyValue& value);
/// A T with the initialisers of its members.
template <class T>
const T& get_defaults() {
  static const T defaults{};
  return defaults;
}
KeyText describe_key(const char* name, const KeyValue& fallback, Need need, const char* meaning, const Limits& limits,
                     const std::vector<std::string>& words);

/// A key of an object that is read into a T.
template <class T>
struct Key {
  KeyText text;
  std::function<void(Object&, T&)> read;  // empty: the caller reads the key
  std::function<KeyValue(const T&)> get;

  Key(const char* name, const char* fallback, const char* meaning) : text{name, fallback, meaning} {}

  template <class V>
  Key(const char* name, V T::*member, const Limits& limits, const char* meaning, Need need = Need::optional)
      : text(describe_key(name, to_value(get_defaults<T>().*member), need, meaning, limits, {})),
        read([=](Object& object, T& target) {
          if (need == Need::required || object.has(name)) target.*member = read_value(object, name, limits, static_cast<const V*>(nullptr));
        }),
        get([=](const T& source) { return to_value(source.*member); }) {}
  template <class V>
  Key(const char* name, V T::*member, const char* meaning, Need need = Need::optional) : Key(name, member, Limits{}, meaning, need) {}

  /// One of `words`: a text, or an enumeration in their order.
  template <class V>
  Key(const char* name, V T::*member, const std::vector<std::string>& words, const char* meaning, Need need = Need::optional)
      : read([=](Object& object, T& target) {
          if (need != Need::required && !object.has(name)) return;
          const std::size_t index = read_word(object, name, words);
          if constexpr (std::is_same_v<V, std::string>)
            target.*member = words[index];
          else
            target.*member = static_cast<V>(index);
        }),
        get([=](const T& source) {
          if constexpr (std::is_same_v<V, std::string>)
            return to_value(source.*member);
          else
            return KeyValue(words[static_cast<std::size_t>(source.*member)]);
        }) {
    text = describe_key(name, get(get_defaults<T>()), need, meaning, {}, words);
  }
};

/// The keys of an object.
template <class T>
class Keys {
 public:
  Keys(std::initializer_list<Key<T>> keys) : keys_(keys) {}

  /// Reads the keys that are bound to a member.
  void read(Object& object, T& target) const {
    for (const Key<T>& key : keys_)
      if (key.read) key.read(object, target);
  }

  /// Marks all keys as known, for messages about misspelt ones.
  void expect(Object& object) const {
    for (const Key<T>& key : keys_) object.ignore(key.text.name);
  }

  /// Members with a value, in the order of declaration.
  std::vector<std::pair<std::string, KeyValue>> get(const T& source) const {
    std::vector<std::pair<std::string, KeyValue>> values;
    for (const Key<T>& key : keys_)
      if (key.get)
        if (KeyValue value = key.get(source); value.index() != 0) values.emplace_back(key.text.name, std::move(value));
    return values;
  }
  /// Adds these values to `json`.
  Json write(const T& source, Json json = Json::object()) const {
    for (const auto& [name, value] : get(source)) json.set(name, to_json(value));
    return json;
  }

  /// Appends the rows to a table, with a prefix such as "listener.".
  void describe(KeyTable& table, const std::string& prefix = "") const {
    for (const Key<T>& key : keys_) table.rows.push_back({prefix + key.text.name, key.text.fallback, key.text.meaning});
  }

 private:
  std::vector<Key<T>> keys_;
};

}  // namespace carillon::base

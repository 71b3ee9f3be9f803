// SPDX-License-Identifier: MIT
/// What JSON is and what it is not, after RFC 8259, row by row: the usual ways to be wrong, and the places where readers differ.
///
///     YES  is JSON, and read          NO   is not, and refused
///     OWN_YES, OWN_NO                 the RFC leaves it open; that is how ours decides
///
/// test/fuzz/seeds.py reads the rows too: keep each on one line.
#ifndef TEST_JSON_VECTORS_H
#define TEST_JSON_VECTORS_H

// clang-format off
#define JSON_VECTORS(YES, NO, OWN_YES, OWN_NO) \
    YES("an empty object", "{}") \
    YES("an empty list", "[]") \
    YES("blanks of every kind", " \t\r\n[ \t\r\n1 \t\r\n, \t\r\n2 ] \t\r\n") \
    YES("blanks in an empty object", "{ \n }") \
    YES("one of each", "[null,true,false,0,-1,1.5,\"\",{},[]]") \
    YES("members", "{\"a\":1,\"b\":\"2\",\"c\":[3],\"d\":{\"e\":4}}") \
    YES("an empty name", "{\"\":0}") \
    YES("names that differ in case", "{\"a\":1,\"A\":2}") \
    YES("the same name in another object", "{\"a\":{\"a\":{\"a\":1}}}") \
    YES("the same name in objects side by side", "[{\"a\":1},{\"a\":2}]") \
    YES("a name again after an object with it", "{\"b\":{\"a\":1},\"a\":2}") \
    YES("a name that begins as another", "{\"ab\":1,\"a\":2,\"abc\":3}") \
    YES("eight deep, lists", "[[[[[[[[]]]]]]]]") \
    YES("eight deep, objects", "{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{}}}}}}}}") \
    YES("eight deep twice", "[[[[[[[[]]]]]]],[[[[[[[]]]]]]]]") \
    YES("brackets in a text", "[\"[[[[[[[[[[[[{{{{{{{{{{\"]") \
    YES("a comment in a text", "[\"/*x*/ //y\"]") \
    YES("zero", "[0]") \
    YES("minus zero", "[-0]") \
    YES("digits", "[1234567890]") \
    YES("the largest integer", "[9223372036854775807]") \
    YES("the smallest integer", "[-9223372036854775808]") \
    YES("a fraction", "[0.5]") \
    YES("a long fraction", "[3.14159265358979323846264338327950288419716939937510582097494459]") \
    YES("a fraction of zeros", "[1.000]") \
    YES("minus zero with a fraction", "[-0.0]") \
    YES("an exponent", "[1e2]") \
    YES("an exponent with a plus", "[1E+2]") \
    YES("an exponent with a minus", "[1e-2]") \
    YES("an exponent with zeros before", "[1e007]") \
    YES("zero with an exponent", "[0e1]") \
    YES("zero with a large exponent", "[0e999999999999]") \
    YES("a fraction and an exponent", "[-12.5e-3]") \
    YES("a number behind a blank", "[ 4]") \
    YES("the largest double", "[1.7976931348623157e308]") \
    YES("the largest double written small", "[0.00017976931348623157e312]") \
    YES("the largest double written large", "[17976931348623157e292]") \
    YES("just below what is no double", "[1.797693134862315807e308]") \
    YES("an exponent of 308 with a small digit", "[1e308]") \
    YES("every short escape", "[\"\\\"\\\\\\/\\b\\f\\n\\r\\t\"]") \
    YES("a unicode escape", "[\"\\u0041\\u00e9\\u20AC\"]") \
    YES("a unicode escape in both cases", "[\"\\uabcd\\uABCD\"]") \
    YES("a surrogate pair", "[\"\\uD83D\\ude00\"]") \
    YES("two surrogate pairs", "[\"\\uD83D\\uDE00\\uD83D\\uDE01\"]") \
    YES("the last surrogate pair", "[\"\\uDBFF\\uDFFF\"]") \
    YES("a backslash before u0000", "[\"\\\\u0000\"]") \
    YES("an escaped quote at the end", "[\"a\\\"\"]") \
    YES("escaped backslashes at the end", "[\"a\\\\\\\\\"]") \
    YES("an escaped control character", "[\"\\u001f\\u0001\"]") \
    YES("two bytes of UTF-8", "[\"\xC3\xA9\"]") \
    YES("three bytes of UTF-8", "[\"\xE2\x82\xAC\"]") \
    YES("four bytes of UTF-8", "[\"\xF0\x9F\x98\x80\"]") \
    YES("the least of two bytes", "[\"\xC2\x80\"]") \
    YES("the most of two bytes", "[\"\xDF\xBF\"]") \
    YES("the least of three bytes", "[\"\xE0\xA0\x80\"]") \
    YES("the last before the surrogates", "[\"\xED\x9F\xBF\"]") \
    YES("the first behind the surrogates", "[\"\xEE\x80\x80\"]") \
    YES("the least of four bytes", "[\"\xF0\x90\x80\x80\"]") \
    YES("the last code point", "[\"\xF4\x8F\xBF\xBF\"]") \
    YES("no characters", "[\"\xEF\xBF\xBE\xEF\xBF\xBF\\uFFFE\\uFFFF\"]") \
    YES("delete, which is no control character here", "[\"\x7F\"]") \
    YES("separators of lines", "[\"\xE2\x80\xA8\xE2\x80\xA9\"]") \
    YES("UTF-8 in a name", "{\"\xE2\x82\xAC\":1}") \
    YES("an escape in a name", "{\"a\\u0062\":1}") \
    NO("nothing", "") \
    NO("a blank", " ") \
    NO("a half object", "{") \
    NO("a half list", "[") \
    NO("an end alone", "}") \
    NO("an end of a list alone", "]") \
    NO("an end too many", "[]]") \
    NO("an end of another kind", "[}") \
    NO("an end of the other kind", "{]") \
    NO("ends crossed", "[{]}") \
    NO("a list that goes on", "[1,2") \
    NO("a list that ends in a comma", "[1,]") \
    NO("a list that begins with a comma", "[,1]") \
    NO("two commas", "[1,,2]") \
    NO("a comma alone", "[,]") \
    NO("no comma", "[1 2]") \
    NO("a colon for a comma", "[1:2]") \
    NO("a list of a half text", "[\"a]") \
    NO("half a list behind a comma", "[1,") \
    NO("two values", "[1][2]") \
    NO("something behind", "[] x") \
    NO("a comma behind", "{},") \
    NO("a hash behind", "{}#") \
    NO("a comment behind", "{}/**/") \
    NO("a comment in it", "[1/*x*/]") \
    NO("a comment of a line", "[1//x\n]") \
    NO("a name alone", "{\"a\"}") \
    NO("no value", "{\"a\":}") \
    NO("no colon", "{\"a\" 1}") \
    NO("two colons", "{\"a\"::1}") \
    NO("a comma for a colon", "{\"a\",1}") \
    NO("a member that ends the text", "{\"a\":1") \
    NO("an object that ends in a comma", "{\"a\":1,}") \
    NO("an object that begins with a comma", "{,\"a\":1}") \
    NO("two commas in an object", "{\"a\":1,,\"b\":2}") \
    NO("no comma in an object", "{\"a\":1 \"b\":2}") \
    NO("a name without quotes", "{a:1}") \
    NO("a name in single quotes", "{'a':1}") \
    NO("a number for a name", "{1:1}") \
    NO("null for a name", "{null:1}") \
    NO("a list for a name", "{[]:1}") \
    NO("a name twice", "{\"a\":1,\"a\":1}") \
    NO("a name twice, with others between", "{\"b\":1,\"a\":2,\"c\":3,\"d\":4,\"b\":5}") \
    NO("a name twice, spelt otherwise", "{\"ab\":1,\"\\u0061b\":2}") \
    NO("a name twice, as a pair and as bytes", "{\"\xF0\x9F\x98\x80\":1,\"\\uD83D\\uDE00\":2}") \
    NO("a name twice, escaped otherwise", "{\"/\":1,\"\\/\":2}") \
    NO("an empty name twice", "{\"\":1,\"\":2}") \
    NO("a name twice in an inner object", "{\"x\":{\"a\":1,\"a\":2}}") \
    NO("a name twice around an object with it", "{\"a\":{\"a\":1},\"a\":2}") \
    NO("a name twice behind an inner object", "{\"a\":1,\"x\":{\"b\":1,\"c\":2},\"a\":2}") \
    NO("a name twice in a list of objects", "[{\"a\":1},{\"b\":1,\"b\":2}]") \
    NO("nine deep", "[[[[[[[[[]]]]]]]]]") \
    NO("nine deep at the end", "[1,[[[[[[[[1]]]]]]]]]") \
    NO("nine deep, objects", "{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{\"a\":{}}}}}}}}}") \
    NO("true in part", "[tru]") \
    NO("true and more", "[truee]") \
    NO("True", "[True]") \
    NO("FALSE", "[FALSE]") \
    NO("nul", "[nul]") \
    NO("nil", "[nil]") \
    NO("undefined", "[undefined]") \
    NO("NaN", "[NaN]") \
    NO("minus NaN", "[-NaN]") \
    NO("Infinity", "[Infinity]") \
    NO("minus Infinity", "[-Infinity]") \
    NO("a word", "[a]") \
    NO("words side by side", "[true false]") \
    NO("words without a blank", "[true\xC3\xA9]") \
    NO("a minus alone", "[-]") \
    NO("two minuses", "[--1]") \
    NO("a plus", "[+1]") \
    NO("a minus and a blank", "[- 1]") \
    NO("a minus and a letter", "[-x]") \
    NO("a leading zero", "[01]") \
    NO("two zeros", "[00]") \
    NO("a negative leading zero", "[-01]") \
    NO("a leading zero before a fraction", "[00.5]") \
    NO("hexadecimal", "[0x1F]") \
    NO("octal", "[0o17]") \
    NO("binary", "[0b1]") \
    NO("a point at the end", "[1.]") \
    NO("a point at the beginning", "[.5]") \
    NO("a negative point at the beginning", "[-.5]") \
    NO("a point alone", "[.]") \
    NO("two points", "[1.2.3]") \
    NO("a point before an exponent", "[1.e1]") \
    NO("an exponent without digits", "[1e]") \
    NO("an exponent of a sign", "[1e+]") \
    NO("an exponent of two signs", "[1e+-1]") \
    NO("an exponent twice", "[1e1e1]") \
    NO("an exponent with a fraction", "[1e1.5]") \
    NO("an exponent alone", "[e1]") \
    NO("a fraction that ends the text", "[1.") \
    NO("an exponent that ends the text", "[1e") \
    NO("a digit group", "[1_000]") \
    NO("a comma in a number's place", "[1,000]") \
    NO("a number with a letter", "[1a]") \
    NO("digits of another script", "[\xEF\xBC\x91]") \
    NO("a half text", "[\"") \
    NO("a half text with something in it", "[\"abc") \
    NO("a half escape", "[\"\\") \
    NO("a half escape before the end", "[\"\\\"]") \
    NO("single quotes", "['a']") \
    NO("curly quotes", "[\xE2\x80\x9C" "a\xE2\x80\x9D]") \
    NO("no quotes", "[abc]") \
    NO("a line break in a text", "[\"a\nb\"]") \
    NO("a tab in a text", "[\"a\tb\"]") \
    NO("a control character in a text", "[\"\x1F\"]") \
    NO("an escaped line break", "[\"a\\\nb\"]") \
    NO("an escape that is none", "[\"\\a\"]") \
    NO("an escape in capitals", "[\"\\N\"]") \
    NO("an escaped single quote", "[\"\\'\"]") \
    NO("an escaped digit", "[\"\\0\"]") \
    NO("a hexadecimal escape", "[\"\\x41\"]") \
    NO("an escaped blank", "[\"\\ \"]") \
    NO("an escaped letter of UTF-8", "[\"\\\xC3\xA9\"]") \
    NO("a unicode escape of three digits", "[\"\\u004\"]") \
    NO("a unicode escape of no digit", "[\"\\u\"]") \
    NO("a unicode escape with a letter", "[\"\\u004g\"]") \
    NO("a unicode escape in capitals", "[\"\\U0041\"]") \
    NO("a unicode escape in braces", "[\"\\u{41}\"]") \
    NO("a unicode escape with a sign", "[\"\\u+041\"]") \
    NO("a unicode escape that ends the text", "[\"\\u00") \
    NO("a blank outside of JSON", "[\xC2\xA0]") \
    NO("a form feed", "[\f]") \
    NO("a vertical tab", "[\v]") \
    NO("a control character", "[\x01]") \
    NO("an at", "[@]") \
    NO("a semicolon", "[1;2]") \
    NO("parentheses", "(1)") \
    NO("a byte order mark", "\xEF\xBB\xBF[]") \
    NO("a single byte beyond ASCII", "[\"\xE9\"]") \
    NO("a byte that continues nothing", "[\"\x80\"]") \
    NO("the last that continues nothing", "[\"\xBF\"]") \
    NO("two bytes, the second missing", "[\"\xC3\"]") \
    NO("three bytes, the third missing", "[\"\xE2\x82\"]") \
    NO("four bytes, the fourth missing", "[\"\xF0\x9F\x98\"]") \
    NO("four bytes cut by the end", "[\"\xF0\x9F") \
    NO("a first byte behind a first byte", "[\"\xC3\xC3\xA9\"]") \
    NO("two bytes for one", "[\"\xC0\xAF\"]") \
    NO("two bytes for delete", "[\"\xC1\xBF\"]") \
    NO("three bytes for two", "[\"\xE0\x80\xAF\"]") \
    NO("three bytes for the last of two", "[\"\xE0\x9F\xBF\"]") \
    NO("four bytes for three", "[\"\xF0\x8F\xBF\xBF\"]") \
    NO("a surrogate in UTF-8", "[\"\xED\xA0\x80\"]") \
    NO("the last surrogate in UTF-8", "[\"\xED\xBF\xBF\"]") \
    NO("a pair of surrogates in UTF-8", "[\"\xED\xA0\xBD\xED\xB8\x80\"]") \
    NO("beyond the last code point", "[\"\xF4\x90\x80\x80\"]") \
    NO("a first byte that is none", "[\"\xF5\x80\x80\x80\"]") \
    NO("five bytes", "[\"\xF8\x88\x80\x80\x80\"]") \
    NO("six bytes", "[\"\xFC\x84\x80\x80\x80\x80\"]") \
    NO("FE and FF", "[\"\xFE\xFF\"]") \
    NO("UTF-16", "\xFF\xFE[") \
    NO("bad UTF-8 outside a text", "[\xFF]") \
    NO("bad UTF-8 behind a number", "[1\xFF]") \
    NO("bad UTF-8 behind everything", "[]\xFF") \
    NO("bad UTF-8 in a name", "{\"\xFF\":1}") \
    OWN_NO("a number alone", "1") \
    OWN_NO("a text alone", "\"a\"") \
    OWN_NO("null alone", "null") \
    OWN_NO("a first surrogate alone", "[\"\\uD800\"]") \
    OWN_NO("a second surrogate alone", "[\"\\uDC00\"]") \
    OWN_NO("surrogates the wrong way round", "[\"\\uDE00\\uD83D\"]") \
    OWN_NO("two first surrogates", "[\"\\uD83D\\uD83D\"]") \
    OWN_NO("a first surrogate before a letter", "[\"\\uD800a\"]") \
    OWN_NO("a first surrogate before another escape", "[\"\\uD800\\n\"]") \
    OWN_NO("a first surrogate before a common character", "[\"\\uD800\\u0041\"]") \
    OWN_NO("a first surrogate in a name", "{\"\\uD800\":1}") \
    OWN_NO("NUL in a text", "[\"a\\u0000b\"]") \
    OWN_NO("NUL in a name", "{\"a\\u0000\":1}") \
    OWN_NO("one beyond the largest integer", "[9223372036854775808]") \
    OWN_NO("one below the smallest integer", "[-9223372036854775809]") \
    OWN_NO("an integer of twenty digits", "[10000000000000000000]") \
    OWN_NO("an integer of many digits", "[123456789012345678901234567890123456789012345678901234567890]") \
    OWN_NO("beyond every double", "[1e309]") \
    OWN_NO("below every double", "[-1e309]") \
    OWN_NO("far beyond every double", "[0.4e00669999999999999999999999999999999]") \
    OWN_NO("just beyond the largest double", "[1.7976931348623159e308]") \
    OWN_NO("just beyond, written as an integer with an exponent", "[17976931348623159e292]") \
    OWN_YES("too small for a double", "[1e-400]") \
    OWN_YES("far too small for a double", "[-123.456e-99999999999999999999]") \
    OWN_YES("more digits than a double holds", "[0.1234567890123456789012345678901234567890]") \
    OWN_YES("an exponent made up for by zeros", "[0.0000000000000000000000000000000000000000000000000001e320]")
// clang-format on

#endif

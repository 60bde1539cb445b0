"""Messages of the values that a field accepts."""

from station.messages.message import Nested, Number, define, define_plural

EXACTLY = define("expect.exactly", "{value}")
ONE_OF = define("expect.one_of", "one of {choices}")
SWITCH = define("expect.switch", "true or false")
INTEGER = define("expect.integer", "an integer")
INTEGER_IN = define("expect.integer_in", "an integer in{unit}")
INTEGER_BETWEEN = define(
    "expect.integer_between", "an integer from {least} to {most}{unit}", least=Number(), most=Number()
)
INTEGER_IF = define("expect.integer_if", "an integer {condition}{unit}", condition=Nested())
NUMBER = define("expect.number", "a number")
NUMBER_IN = define("expect.number_in", "a number in{unit}")
NUMBER_BETWEEN = define("expect.number_between", "a number from {least} to {most}{unit}", least=Number(), most=Number())
NUMBER_IF = define("expect.number_if", "a number {condition}{unit}", condition=Nested())
AT_LEAST = define("expect.at_least", "at least {value}", value=Number())
ABOVE = define("expect.above", "above {value}", value=Number())
AT_MOST = define("expect.at_most", "at most {value}", value=Number())
BELOW = define("expect.below", "below {value}", value=Number())
BOTH = define("expect.both", "{first} and {second}", first=Nested(), second=Nested())
TEXT = define("expect.text", "a text")
PATH = define("expect.path", "a path")
TEXT_OF = define("expect.text_of", "{text} of {length}", text=Nested(), length=Nested())
MATCHING = define("expect.matching", "{text} that matches {pattern}", text=Nested())
CHARACTERS = define_plural("expect.characters", "{number} character", "{number} characters", "number")
CHARACTERS_LEAST = define_plural(
    "expect.characters_least", "at least {number} character", "at least {number} characters", "number"
)
CHARACTERS_MOST = define_plural(
    "expect.characters_most", "at most {number} character", "at most {number} characters", "number"
)
CHARACTERS_BETWEEN = define("expect.characters_between", "{least} to {most} characters", least=Number(), most=Number())
LIST = define("expect.list", "a list")
LIST_OF = define("expect.list_of", "a list of {length}", length=Nested())
EACH = define("expect.each", "{list}, each {item}", list=Nested(), item=Nested())
ITEMS = define_plural("expect.items", "{number} item", "{number} items", "number")
ITEMS_LEAST = define_plural("expect.items_least", "at least {number} item", "at least {number} items", "number")
ITEMS_MOST = define_plural("expect.items_most", "at most {number} item", "at most {number} items", "number")
ITEMS_BETWEEN = define("expect.items_between", "{least} to {most} items", least=Number(), most=Number())
MAPPING = define("expect.mapping", "a mapping")
MAPPING_WITH = define("expect.mapping_with", "a mapping with {names}")
OR_NULL = define("expect.or_null", "{value} or null", value=Nested())
EITHER = define("expect.either", "{first} or {second}", first=Nested(), second=Nested())

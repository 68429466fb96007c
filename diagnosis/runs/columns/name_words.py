"""The words of a column's name, in English and without short forms."""

import re
import unicodedata

# English words -> those that names have in their place: short forms, German, French, Spanish, Italian,
# Portuguese, Dutch, Norwegian, Swedish, Polish, all without accents.
FOREIGN = {
    "starboard": (
        "stbd stb sb right steuerbord tribord estribor dritta stuurboord styrbord boreste prawa"
    ),
    "port": "left ps bb backbord babord babor sinistra bakboord bombordo lewa",
    "propeller": "prop screw helice elica schroef sruba sruby",
    "rudder": "rud steer steering helm ruder gouvernail safran barre timon timone roer roder leme",
    "rudder angle": "rsa ruderlage ruderwinkel roerhoek rorvinkel rodervinkel",
    "bow": "bowthr bowthruster bug bugstrahl bugstrahler bugstrahlruder boeg baug",
    "stern": "sternthr sternthruster heck heckstrahl heckstrahler heckstrahlruder hek",
    "fore": "fwd forward vorn forut",
    "aft": "achter akter",
    "azimuth": "azi azimut azimute",
    "thruster": "thr tunnel propulseur strahlruder boegschroef pednik pednika",
    "angle": "winkel vinkel angulo angolo hoek kat",
    "rpm": (
        "drehzahl regime toerental turtall omdreiningstall omdreininger varvtal giri rotacao rotacoes "
        "obroty"
    ),
    "order": "set setpoint setp sp ord demand demanded soll sollwert consigne orden ordre",
    "measured": "act actual fb fbk feedb feedback ist istwert mesure medido gemeten",  # codespell:ignore
    "true": "vrai vraie wahr verdadero",
    "time": "zeit uhrzeit temps heure tiempo tempo tijd tid czas",
    "timestamp": "zeitstempel horodatage",
    "north": "nord norte noord polnoc",
    "east": "ost este oost leste wschod",
    "northing": "hochwert nordwert",
    "easting": "rechtswert ostwert",
    "latitude": "breite breitengrad latitud latitudine breedtegraad breddegrad",
    "longitude": "lange langengrad longitud longitudine lengtegraad lengdegrad",
    "heading": "steuerkurs gierwinkel cap prua",
    "yaw rate": "gierrate wenderate",
    "value": "wert valeur valor valore waarde verdi varde wartosc",
    "unit": "einheit unite unidad unita eenheid enhet",
    "speed": "geschwindigkeit vitesse velocidad snelheid fart",
}
ENGLISH = {word: english for english, words in FOREIGN.items() for word in words.split()}
# Letters that are no other letter with an accent.
PLAIN = str.maketrans({"ø": "o", "æ": "ae", "œ": "oe", "ß": "ss", "ł": "l", "δ": "delta", "ψ": "psi"})
MAGNETIC = frozenset(("magnetic", "mag", "hdm"))
# The same in Chinese and Japanese, where no blanks are between words.
UNSPACED = {
    "time": "时间 時間 時刻",
    "north": "北向 北",
    "east": "东向 東 东",
    "heading": "首向 艏向角 艏向 船首方位",
    "latitude": "纬度 緯度",
    "longitude": "经度 経度",
    "rudder angle": "舵角",
    "rudder": "舵",
    "rpm": "转速 回転数",
    "port": "左舷 左",
    "starboard": "右舷 右",
    "propeller": "螺旋桨 推进器 プロペラ",
    "bow": "バウ 艏 船首",
    "stern": "スターン 艉 船尾",
    "thruster": "スラスタ 侧推",
}


def _plain(text: str) -> str:
    """A text in small letters without accents."""
    letters = unicodedata.normalize("NFKD", text).casefold().translate(PLAIN)
    return "".join(c for c in letters if not unicodedata.combining(c))


ENGLISH |= {_plain(word): english for english, words in UNSPACED.items() for word in words.split()}
WORDS = "|".join(sorted((w for w in ENGLISH if not w.isascii()), key=len, reverse=True))


def is_magnetic(name: str) -> bool:
    """Whether a name is that of a heading by a magnetic compass."""
    return not MAGNETIC.isdisjoint(words_of(name))


def words_of(name: str) -> list[str]:
    """The words of a name, small letters; numbers are words of their own."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    found: list[str] = re.findall(rf"[a-z]+|\d+|{WORDS}", _plain(apart))
    return " ".join(ENGLISH.get(word, word) for word in found).split()
